"""A rigid box on two or three feet with friction, which slip at the same velocity while
it lies flat: the friction of each foot is indeterminate, and with three feet the normal
forces are too; the motion is not.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcam
from jaxcam.hybrid import SwitchedSystem


GRAVITY = 9.81


def _number(value) -> jax.Array:
    """A field that is an array, so that one program serves all values."""
    return eqx.field(converter=jnp.asarray, default=value)


class Box(SwitchedSystem):
    """Position of the centre and angle, and their rates; unit mass."""

    mu: jax.Array = _number(0.3)
    restitution: jax.Array = _number(0.4)
    half_width: jax.Array = _number(0.5)
    height: jax.Array = _number(0.2)
    inertia: jax.Array = _number(0.1)
    order: jax.Array = _number(1.0)  # -1 exchanges the feet
    amplitude: jax.Array = _number(0.0)
    omega: jax.Array = _number(3.0)
    incline: jax.Array = _number(0.0)
    floor: jax.Array = _number(0.0)
    feet: int = eqx.field(static=True, default=2)

    def _feet(self, state):
        c, s = jnp.cos(state[2]), jnp.sin(state[2])
        reaches = self.order * self.half_width * np.linspace(-1.0, 1.0, self.feet)
        return [(a * c + self.height * s, a * s - self.height * c) for a in reaches]

    def switching(self, t, state):
        return jnp.stack([state[3] - state[5] * y for _, y in self._feet(state)])

    def gap(self, t, state):
        return jnp.stack([state[1] - self.floor + y for _, y in self._feet(state)])

    def branch(self, t, state, sides):
        along = self.amplitude * jnp.cos(self.omega * t)
        along = along + GRAVITY * jnp.sin(self.incline)
        down = -GRAVITY * jnp.cos(self.incline)
        return jnp.stack([state[3], state[4], state[5], along, down, 0.0])

    def impact(self, t, state):
        rows = []
        for x, _ in self._feet(state):
            mass = 1 / (1 + x**2 / self.inertia)
            push = -(1 + self.restitution) * (state[4] + state[5] * x) * mass
            rows.append(state.at[4].add(push).at[5].add(x * push / self.inertia))
        return jnp.stack(rows)

    def contact_friction(self, t, state, sides):
        rows = []
        for k, (x, y) in enumerate(self._feet(state)):
            push = -self.mu * sides[k] / (1 + x**2 / self.inertia)
            turn = -y * push / self.inertia
            rows.append(jnp.stack([0.0, 0.0, 0.0, push, 0.0, turn]))
        return jnp.stack(rows)


class Block(SwitchedSystem):
    """The same body without rotation: position and velocity."""

    mu: jax.Array = _number(0.3)
    amplitude: jax.Array = _number(0.0)
    omega: jax.Array = _number(3.0)

    def switching(self, t, state):
        return state[1]

    def branch(self, t, state, sides):
        force = self.amplitude * jnp.cos(self.omega * t)
        return jnp.stack([state[1], force - self.mu * GRAVITY * sides[0]])


# below and above the acceleration at which the box slips
AMPLITUDES = [2.0, 2.9, 4.0]


@pytest.mark.parametrize("amplitude", AMPLITUDES)
def test_a_shaken_box_is_a_block(amplitude, feet=2):
    """Positions to 1e-9, below and above the acceleration at which it slips."""
    times = jnp.linspace(0.0, 6.0, 25)
    start = [0.0, 0.2, 0.0, 0.5, 0.0, 0.0]
    run = jaxcam.simulate(Box(amplitude=amplitude, feet=feet), start, 0.0, 6.0)
    block = jaxcam.simulate(Block(amplitude=amplitude), [0.0, 0.5], 0.0, 6.0)
    assert run.successful, run.result
    np.testing.assert_allclose(run.at(times)[:, 0], block.at(times)[:, 0], atol=1e-9)
    # the start and the end of sticking of either foot, to 1e-9 s
    found, known = (np.asarray(one.switches.time) for one in (run, block))
    apart = np.abs(found[:, None] - known[None])
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-9


@pytest.mark.parametrize("mu", [0.1, 0.3])
def test_a_box_at_rest_on_a_slope(mu, feet=2):
    """It stays if the slope is less than `mu`; otherwise, it slides as a block does, to
    1e-12.
    """
    incline = 0.2
    run = jaxcam.simulate(
        Box(mu=mu, incline=incline, feet=feet), [0.0, 0.2, 0.0, 0.0, 0.0, 0.0], 0.0, 1.0
    )
    pull = max(np.sin(incline) - mu * np.cos(incline), 0.0) * GRAVITY
    assert run.successful, run.result
    np.testing.assert_allclose(
        run.final, [pull / 2, 0.2, 0.0, pull, 0.0, 0.0], atol=1e-12
    )


# boxes that fall flat and at an angle; of the last two, the slip stops during chatter,
# and is only rounding error at a joint impact
DROPS = [
    [0.0, 0.5, 0.0, 1.5, 0.0, 0.0],
    [0.0, 0.5549596893285635, 0.0, 1.7987863384903786, 0.0, 0.0],
    [0.0, 0.48, -0.2266305607134217, -0.9058431408224087, 0.0, -0.8163147296909071],
    [0.0, 0.548, 0.17112657559582284, -0.5801952016057006, 0.0, 1.2715513764583872],
    [0.0, 0.5278399730467005, 0.0, 0.2814308365081419, 0.0, 0.0],
]


@pytest.mark.parametrize("start", DROPS)
def test_a_box_that_falls_comes_to_rest(start, feet=2):
    """On both feet and without slip, whatever their order; no impact adds energy."""
    ends = []
    for order in (1.0, -1.0):
        run = jaxcam.simulate(Box(order=order, feet=feet), start, 0.0, 2.0)
        assert run.successful, run.result
        np.testing.assert_allclose(run.final[1:], [0.2, 0, 0, 0, 0], atol=1e-9)
        before, after = (
            np.square(np.asarray(state)[:, 3:]) @ [1.0, 1.0, 0.1]
            for state in (run.impacts.before, run.impacts.after)
        )
        assert np.all(after - before <= 1e-12)
        ends.append(float(run.final[0]))
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_the_origin_of_the_height_makes_no_difference(feet=2):
    """The centre of a box that comes to rest has the height zero: rounding errors of
    the gaps are as large as the gaps. To 1e-12.
    """
    start = np.array(DROPS[2])
    ends = []
    for floor in (0.0, -0.2):
        box = Box(feet=feet, floor=floor)
        run = jaxcam.simulate(box, start + [0, floor, 0, 0, 0, 0], 0.0, 2.0)
        assert run.successful, run.result
        ends.append(np.asarray(run.final) - [0, floor, 0, 0, 0, 0])
    np.testing.assert_allclose(*ends, atol=1e-12)


@pytest.mark.slow
def test_three_feet():
    """All of the above with a third foot in the middle; in one test, because the
    program takes long to compile.
    """
    for amplitude in AMPLITUDES:
        test_a_shaken_box_is_a_block(amplitude, 3)
    for mu in (0.1, 0.3):
        test_a_box_at_rest_on_a_slope(mu, 3)
    for start in DROPS:
        test_a_box_that_falls_comes_to_rest(start, 3)
    test_the_origin_of_the_height_makes_no_difference(3)
