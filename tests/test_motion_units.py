"""The same motion in other units, and from other origins of its coordinates.

Lengths are multiplied by s and times by tau. Numbers of impacts and contacts must be
equal, times equal to 1e-9 of the run and states to 1e-8 of their largest.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import BallBetweenWalls, InUnits, parameters, TwoMasses

from jaxcam import HybridSystem, Settings, simulate
from jaxcam.hybrid import stroboscope
from jaxcam.models import (
    BouncingBall,
    CamFollower,
    ImpactOscillator,
    TripleIntegrator,
)


# how many derivatives by the time each component is, start and length of the run
CASES = {
    "ball": (BouncingBall(), (0, 1), [1.0, 0.0], 4.2),
    "oscillator": (ImpactOscillator(2.8, 0.8, 0.0, 0.05), (0, 1), [-0.2, 0.0], 30.0),
    "sticking oscillator": (ImpactOscillator(2.0, 0.3), (0, 1), [-0.2, 0.0], 30.0),
    "cam": (CamFollower(speed=15.18), (0, 1), [0.338, 0.224], 2.0),
    "two walls": (
        BallBetweenWalls(**parameters(gravity=9.81, width=1.0, restitution=0.9)),
        (0, 1),
        [0.5, 7.0],
        2.0,
    ),
    "two masses": (
        TwoMasses(
            **parameters(
                omega=1.2,
                stop=0.1,
                restitution=0.7,
                force=1.0,
                stiffness=1.0,
                damping=0.1,
            )
        ),
        (0, 0, 1, 1),
        [-0.5, 0.0, 0.0, 0.1],
        30.0,
    ),
    "three states": (TripleIntegrator(0.6), (0, 1, 2), [0.5, 0.5, -3.0], 4.0),
}


def compared(case, length, time, origin=0.0, engine="loop"):
    """The run as it is stated and the one in other units, in the units of the first."""
    system, orders, start, end = CASES[case]
    plain = simulate(system, jnp.array(start), 0.0, end, engine=engine)
    units = length * float(time) ** -np.array(orders, dtype=float)
    moved = np.where(np.array(orders) == 0, origin, 0.0)
    other = InUnits(system, *map(jnp.asarray, (units, length, time, moved)))
    state = jnp.asarray(units * np.array(start) + moved)
    made = simulate(other, state, 0.0, end * time, engine=engine)
    assert plain.successful and made.successful, made.result
    back = (np.asarray(made.final) - moved) / units
    return plain, made, back


def assert_same(plain, made, back, time, end, times=1e-9, states=1e-8):
    assert int(made.impacts.count) == int(plain.impacts.count)
    assert int(made.contacts.count) == int(plain.contacts.count)
    for name, part in (("impacts", "time"), ("contacts", "start"), ("contacts", "end")):
        ours, theirs = (getattr(getattr(r, name), part) for r in (made, plain))
        np.testing.assert_allclose(
            np.asarray(ours) / time, theirs, rtol=0, atol=times * end
        )
    size = np.max(np.abs(plain.steps.state), axis=0)
    assert np.all(np.abs(back - np.asarray(plain.final)) <= states * size)


SOME = [
    ("ball", 1e-6, 1.0),
    ("oscillator", 1e-6, 1e6),
    ("two masses", 1e6, 1e-6),
    ("three states", 1e-6, 1.0),
]
ALL = [
    (case, length, time)
    for case in CASES
    for length in (1e-6, 1e-3, 1e6)
    for time in (1e-6, 1.0, 1e6)
    if (case, length, time) not in SOME
]


@pytest.mark.parametrize("case, length, time", SOME)
def test_units_change_nothing(case, length, time):
    assert_same(*compared(case, length, time), time, CASES[case][3])


@pytest.mark.slow
@pytest.mark.parametrize("case, length, time", ALL)
def test_no_units_change_anything(case, length, time):
    assert_same(*compared(case, length, time), time, CASES[case][3])


@pytest.mark.slow
@pytest.mark.parametrize("length, time", [(1e-6, 1e-6), (1e-6, 1e6), (1e6, 1.0)])
@pytest.mark.parametrize("case", ["oscillator", "two walls", "three states"])
def test_units_change_nothing_in_the_second_engine(case, length, time):
    found = compared(case, length, time, engine="diffeqsolve")
    assert_same(*found, time, CASES[case][3])


def test_micrometres_by_the_closed_form():
    """A ball 1e-6 m above the floor: impacts at sqrt(2 h/g) (1 + 2 sum r^k)."""
    height, r, gravity = 1e-6, 0.8, 9.81
    drop = np.sqrt(2 * height / gravity)
    exact = drop * (1 + 2 * np.cumsum(np.append(0.0, r ** np.arange(1, 9))))
    ball = BouncingBall(gravity, r)
    made = simulate(ball, jnp.array([height, 0.0]), 0.0, 0.99 * drop * 9)
    number = int(np.sum(exact < 0.99 * drop * 9))
    np.testing.assert_allclose(made.impacts.time[:number], exact[:number], rtol=1e-9)


@pytest.mark.parametrize("origin", [1e3])
def test_the_gap_counts_and_not_the_coordinate(origin):
    """At a coordinate of 1000 gaps are known to 1e-13, which is all that is lost."""
    plain, made, back = compared("oscillator", 1.0, 1.0, origin)
    assert_same(plain, made, back, 1.0, CASES["oscillator"][3], 1e-9, 1e-9)


class Counted(ImpactOscillator):
    """An oscillator with a phase that grows a million times as fast as it moves."""

    def vector_field(self, t, state):
        rates = super().vector_field(t, state[:2])
        return jnp.concatenate([rates, jnp.full(1, 1e6)])

    def impact(self, t, state):
        return jnp.concatenate([super().impact(t, state[:2]), state[2:]])


Counted.state_names = ()


def test_a_component_that_grows_does_not_loosen_the_others():
    case = CASES["oscillator"]
    system, start, end = Counted(2.8, 0.8, 0.0, 0.05), case[2], case[3]
    made = simulate(system, jnp.array([*start, 0.0]), 0.0, end)
    plain = simulate(case[0], jnp.array(start), 0.0, end)
    assert int(made.impacts.count) == int(plain.impacts.count) > 0
    np.testing.assert_allclose(made.impacts.time, plain.impacts.time, atol=1e-9)


class Powers(HybridSystem):
    """z' = t^k from rest at zero: relative to itself its error does not fall.

    State (x, x', z), and x'' = z.
    """

    power: int = eqx.field(static=True, default=9)

    def vector_field(self, t, state):
        return jnp.stack([state[1], state[2], t**self.power])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return state * jnp.array([1.0, -1.0, 1.0])


@pytest.mark.parametrize("height", [0.0, 1.0])
@pytest.mark.parametrize("power", [9, 20])
def test_a_component_that_starts_at_zero_has_a_scale(height, power):
    made = simulate(Powers(power), jnp.array([height, 0.0, 0.0]), 0.0, 1.0)
    assert made.successful, made.result
    assert int(made.steps.count) < 500
    exact = 1 / np.cumprod(power + np.arange(1.0, 4.0))[::-1]
    np.testing.assert_allclose(made.final - jnp.array([height, 0, 0]), exact, rtol=1e-8)


def test_absolute_errors_that_are_asked_for():
    """1e-3 of the second component allows longer steps than 1e-12 of it."""
    system, start = ImpactOscillator(1.0, 0.8, 50.0, 0.0), jnp.array([1.0, 0.0])
    counts = []
    for absolute in (1e-3, [1e-3, 1e-12], 1e-12):
        settings = Settings(tolerance=1e-12, absolute=jnp.asarray(absolute))
        made = simulate(system, start, 0.0, 30.0, settings=settings)
        counts.append(int(made.steps.count))
    assert counts[0] < counts[1] <= counts[2]
    for bad, words in ((-1.0, "positive"), (jnp.ones(3), "3 numbers")):
        with pytest.raises(ValueError, match=words):
            simulate(system, start, 0.0, 1.0, settings=Settings(absolute=bad))


def test_units_change_no_derivative():
    """By the start, of the state after impacts: one over the units and times them."""
    system, orders, start, _ = CASES["two walls"]
    del orders
    length, time = 1e-6, 1e3
    units = jnp.asarray([length, length / time])
    other = InUnits(system, units, jnp.asarray(length), jnp.asarray(time), jnp.zeros(2))

    def final(system, state, end):
        return simulate(system, state, 0.0, end, max_steps=64).final

    plain = jax.jit(jax.jacfwd(lambda x: final(system, x, 0.4)))(jnp.array(start))
    made = jax.jit(jax.jacfwd(lambda x: final(other, x, 0.4 * time)))(
        units * jnp.array(start)
    )
    back = made / units[:, None] * units[None]
    np.testing.assert_allclose(back, plain, rtol=1e-8, atol=1e-8)


def test_a_start_behind_the_wall_is_refused_in_any_units():
    """1e-13 m is no rounding where everything is picometres long."""
    length = jnp.asarray(1e-12)
    units, nothing = jnp.stack([length, length]), jnp.zeros(2)
    other = InUnits(CASES["oscillator"][0], units, length, jnp.asarray(1.0), nothing)
    with pytest.raises(ValueError, match="gap is negative"):
        simulate(other, jnp.array([1e-13, 0.0]), 0.0, 1.0)
    with pytest.raises(ValueError, match="gap is negative"):
        stroboscope(other, np.array([[-1e-13, 0.0], [1e-13, 0.0]]), 2)
