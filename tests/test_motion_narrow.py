"""Forces and barriers that are narrower than a step, and what makes them seen."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem, Settings, simulate
from jaxcam.hybrid import flow, stroboscope


BEGIN, WIDTH, FORCE = 5.0, 0.03, 4.0


class Kicked(HybridSystem):
    """A body at rest in free space that is pushed for a short time; a floor below."""

    declared: bool = False
    turn: float | None = None
    width: jax.Array | float = WIDTH

    def vector_field(self, t, state):
        phase = t if self.turn is None else jnp.mod(t, self.turn)
        on = (phase >= BEGIN) & (phase < BEGIN + self.width)
        return jnp.stack([state[1], jnp.where(on, FORCE, 0.0)])

    def gap(self, t, state):
        return state[0] + 1.0

    def impact(self, t, state):
        return state * jnp.array([1.0, -0.5])

    @property
    def period(self):
        return self.turn

    @property
    def breakpoints(self):
        if not self.declared:
            return None
        return jnp.stack([jnp.asarray(BEGIN), BEGIN + jnp.asarray(self.width)])


def pushed(t, width=WIDTH):
    """Place and speed at `t` after the push."""
    speed = FORCE * width
    return np.array([speed * (t - BEGIN - width / 2), speed])


@pytest.mark.parametrize("engine", ["loop", "diffeqsolve"])
def test_steps_end_at_breakpoints(engine):
    """Exact: the motion is a polynomial on either side of each."""
    start = jnp.zeros(2)
    made = simulate(Kicked(declared=True), start, 0.0, 10.0, engine=engine)
    assert made.successful
    np.testing.assert_allclose(made.final, pushed(10.0), rtol=0, atol=1e-13)
    times = np.asarray(made.steps.time)
    for wanted in (BEGIN, BEGIN + WIDTH):
        assert np.min(np.abs(times - wanted)) == 0.0
    # a sample just before and just after, and within the push
    look = np.array([BEGIN - 1e-6, BEGIN, BEGIN + 0.01, BEGIN + WIDTH, 7.0])
    since = np.clip(look - BEGIN, 0, WIDTH)
    place = FORCE * since**2 / 2 + FORCE * since * (look - BEGIN - since)
    np.testing.assert_allclose(made.at(look)[:, 0], place, rtol=0, atol=1e-13)
    np.testing.assert_allclose(made.at(look)[:, 1], FORCE * since, rtol=0, atol=1e-13)


def test_breakpoints_recur_with_the_period():
    system, turns = Kicked(declared=True, turn=6.0), 40
    made = simulate(system, jnp.zeros(2), 0.0, 6.0 * turns)
    speed = FORCE * WIDTH * turns
    np.testing.assert_allclose(made.final[1], speed, rtol=1e-12)
    stopped = stroboscope(system, np.zeros((3, 2)), turns)
    np.testing.assert_allclose(stopped.states[:, -1, 1], speed, rtol=1e-12)
    # a start at a breakpoint, and an end at one
    made = simulate(system, jnp.zeros(2), BEGIN + 6, BEGIN + WIDTH + 6)
    np.testing.assert_allclose(made.final[1], FORCE * WIDTH, rtol=1e-12)


def test_a_breakpoint_may_be_a_parameter():
    """The speed after the push grows by the force for each second of its width."""

    def final(width):
        system = Kicked(declared=True, width=width)
        return simulate(system, jnp.zeros(2), 0.0, 10.0, max_steps=256).final

    slope = jax.jit(jax.jacfwd(final))(jnp.asarray(WIDTH))
    exact = [FORCE * (10.0 - BEGIN - WIDTH), FORCE]
    np.testing.assert_allclose(slope, exact, rtol=1e-9)


def test_a_longest_step_shows_a_push_that_is_not_declared():
    exact = pushed(10.0)
    for made in (
        simulate(Kicked(), jnp.zeros(2), 0.0, 10.0, max_step=0.02),
        simulate(Kicked(), jnp.zeros(2), 0.0, 10.0, settings=Settings(max_step=0.02)),
        simulate(
            Kicked(), jnp.zeros(2), 0.0, 10.0, max_step=0.02, engine="diffeqsolve"
        ),
    ):
        assert made.successful
        assert np.max(np.diff(np.asarray(made.steps.time))) <= 0.02 * (1 + 1e-12)
        np.testing.assert_allclose(made.final, exact, rtol=1e-6)
    there = jax.jit(
        lambda x: flow(Kicked(), x, 0.0, 10.0, settings=Settings(max_step=0.02)).state
    )(jnp.zeros(2))
    np.testing.assert_allclose(there, exact, rtol=1e-6)


def test_steps_do_not_outgrow_what_their_errors_say():
    """At rest the estimate is zero: steps are a 64th of the run at most."""
    made = simulate(Kicked(), jnp.zeros(2), 0.0, 10.0)
    assert np.max(np.diff(np.asarray(made.steps.time))) <= 10.0 / 64 * (1 + 1e-12)
    # and a push three times as long as one of them is seen
    made = simulate(Kicked(width=0.5), jnp.zeros(2), 0.0, 10.0)
    np.testing.assert_allclose(made.final, pushed(10.0, 0.5), rtol=1e-6)


class Pressed(HybridSystem):
    """A body that gravity presses on the floor, and that is pushed off once."""

    push: float = 40.0

    def vector_field(self, t, state):
        on = (t > BEGIN) & (t <= BEGIN + WIDTH)
        return jnp.stack([state[1], jnp.where(on, self.push, 0.0) - 9.81])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return state * jnp.array([1.0, -0.5])

    @property
    def breakpoints(self):
        return jnp.array([BEGIN, BEGIN + WIDTH])


@pytest.mark.parametrize("engine", ["loop", "diffeqsolve"])
def test_contact_is_released_at_a_breakpoint(engine):
    """Released at the jump of the force; lands after the throw that it makes."""
    made = simulate(Pressed(), jnp.zeros(2), 0.0, 10.0, engine=engine)
    assert made.successful, made.result
    assert abs(float(made.contacts.end[0]) - BEGIN) < 1e-12
    speed = (40.0 - 9.81) * WIDTH
    height = speed * WIDTH / 2
    flight = (speed + np.sqrt(speed**2 + 2 * 9.81 * height)) / 9.81
    assert abs(float(made.impacts.time[0]) - BEGIN - WIDTH - flight) < 1e-11


class Barrier(HybridSystem):
    """A body that flies at speed one towards a bump of the floor, 0.01 wide."""

    def vector_field(self, t, state):
        return jnp.stack([jnp.ones(()), jnp.zeros(())])

    def gap(self, t, state):
        return 1.0 - 2.0 * jnp.exp(-(((state[0] - 5.003) / 0.01) ** 2)) + state[1]

    def impact(self, t, state):
        return state * jnp.array([1.0, 1.0]) + jnp.array([0.0, 10.0])


def test_a_barrier_is_met_with_a_longest_step():
    exact = 5.003 - 0.01 * np.sqrt(np.log(2.0))
    made = simulate(Barrier(), jnp.zeros(2), 0.0, 10.0, max_step=0.01)
    assert int(made.impacts.count) >= 1
    assert abs(float(made.impacts.time[0]) - exact) < 1e-9


def test_the_first_step_does_not_depend_on_the_end():
    """Tens of periods fit into a 64th of this run."""

    class Fast(HybridSystem):
        def vector_field(self, t, state):
            return jnp.stack([state[1], -(100.0**2) * state[0]])

        def gap(self, t, state):
            return 10.0 + state[0]

        def impact(self, t, state):
            return -state

    steps = [
        np.asarray(simulate(Fast(), jnp.array([1.0, 0.0]), 0.0, end).steps.time)[1]
        for end in (1.0, 3.0)
    ]
    assert steps[0] == steps[1] < 0.01


@pytest.mark.parametrize("given", [0.0, -1.0])
def test_a_longest_step_is_positive(given):
    with pytest.raises(ValueError, match="max_step"):
        simulate(Kicked(), jnp.zeros(2), 0.0, 1.0, max_step=given)
    with pytest.raises(ValueError, match="both"):
        simulate(Kicked(), jnp.zeros(2), 0.0, 1.0, max_step=1.0, settings=Settings())
