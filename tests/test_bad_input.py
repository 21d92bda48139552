"""Bad input is refused before anything runs, in one sentence that names the fix."""

import math
from collections.abc import Callable
from typing import ClassVar

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem, Settings, simulate
from jaxcam.hybrid import flow
from jaxcam.models import (
    BouncingBall,
    CamFollower,
    ConstantRestitution,
    ImpactOscillator,
    preset,
    TripleIntegrator,
)


ABOVE = [1.0, 0.0]


def refusal(system, state, t0=0.0, t1=1.0, **options):
    """The sentence with which a run is refused."""
    with pytest.raises(ValueError) as raised:
        simulate(system, state, t0, t1, **options)
    text = str(raised.value)
    # one sentence, on one line, that a command line can print as it is
    assert text and "\n" not in text and ". " not in text
    return text


# --- states


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", [0, 1])
def test_state_that_is_not_finite(value, place):
    state = list(ABOVE)
    state[place] = value
    assert "every component must be finite" in refusal(BouncingBall(), state)


@pytest.mark.parametrize(
    "system, state, released",
    [
        (BouncingBall(), [-0.1, 0.0], True),
        (ImpactOscillator(wall=0.3), [0.4, 0.0], True),
        (CamFollower(), [0.0, 0.0], True),
        (TripleIntegrator(), [-1e-9, 0.0, -1.0], False),
    ],
)
def test_state_behind_the_constraint(system, state, released):
    """A release point is advised only to systems that have one."""
    text = refusal(system, state)
    assert "gap is negative" in text
    assert "start with every gap at zero or above" in text
    assert ("or pass state=None to start" in text) == released


@pytest.mark.parametrize("state", [[1.0], [1.0, 0.0, 0.0]])
def test_state_of_the_wrong_length(state):
    text = refusal(BouncingBall(), state)
    assert f"state has {len(state)} components" in text
    assert "height, velocity" in text


@pytest.mark.parametrize("state", [1.0, [ABOVE, ABOVE]])
@pytest.mark.usefixtures("unchecked_types")
def test_state_that_is_no_vector(state):
    assert "pass one vector, and use jax.vmap for many" in refusal(
        BouncingBall(), state
    )


# --- times


def test_end_before_start():
    assert "interchange them" in refusal(BouncingBall(), ABOVE, 2.0, 1.0)


@pytest.mark.parametrize("t0, t1", [(np.nan, 1.0), (0.0, np.nan), (0.0, np.inf)])
def test_times_that_are_not_finite(t0, t1):
    assert "finite times" in refusal(BouncingBall(), ABOVE, t0, t1)


# --- settings


@pytest.mark.parametrize("tolerance", [0.0, -1e-9, 1.0, np.nan, np.inf])
def test_meaningless_tolerance(tolerance):
    assert "such as 1e-10" in refusal(BouncingBall(), ABOVE, tolerance=tolerance)


@pytest.mark.parametrize(
    "settings, word",
    [
        (Settings(chatter_smallness=0.0), "chatter_smallness"),
        (Settings(chatter_smallness=0.5), "chatter_smallness"),
        (Settings(chatter_depth=0.0), "chatter_depth"),
        (Settings(chatter_depth=2.0), "chatter_depth"),
    ],
)
def test_meaningless_settings(settings, word):
    assert f"{word} is" in refusal(BouncingBall(), ABOVE, settings=settings)


@pytest.mark.parametrize(
    "options", [{"tolerance": 1e-6}, {"solver": diffrax.Tsit5()}, {"max_step": 0.1}]
)
def test_a_setting_that_is_given_twice(options):
    (name,) = options
    text = refusal(BouncingBall(), ABOVE, settings=Settings(), **options)
    assert text == f"{name} and settings are both given; pass Settings({name}=...)"


def test_flow_checks_its_settings():
    with pytest.raises(ValueError, match="tolerance is -1"):
        flow(BouncingBall(), ABOVE, 0.0, 1.0, settings=Settings(tolerance=-1.0))


@pytest.mark.usefixtures("unchecked_types")
def test_unknown_engine():
    text = refusal(BouncingBall(), ABOVE, engine="leapfrog")
    assert "'leapfrog'" in text and '"loop" or "diffeqsolve"' in text


@pytest.mark.usefixtures("unchecked_types")
def test_unknown_derivatives():
    text = refusal(BouncingBall(), ABOVE, derivatives="backward")
    assert "'backward'" in text and '"forward" or "reverse"' in text


def test_implicit_solver_in_the_loop():
    text = refusal(BouncingBall(), ABOVE, solver=diffrax.Kvaerno5())
    assert "Kvaerno5" in text and 'engine="diffeqsolve"' in text


def test_solver_without_error_estimate():
    text = refusal(BouncingBall(), ABOVE, solver=diffrax.Euler())
    assert "Euler" in text and "diffrax.Dopri8()" in text


# --- parameters


@pytest.mark.parametrize("r", [-0.1, 1.0001, np.nan])
@pytest.mark.parametrize(
    "make, state",
    [
        (lambda r: BouncingBall(restitution=r), ABOVE),
        (lambda r: ImpactOscillator(restitution=r), [-1.0, 0.0]),
        (lambda r: TripleIntegrator(restitution=r), [1.0, 0.0, -1.0]),
        (lambda r: CamFollower(restitution=ConstantRestitution(r)), [0.5, 0.0]),
    ],
)
def test_restitution_out_of_range(make, state, r):
    text = refusal(make(r), state)
    assert "between 0 and 1" in text or "not finite" in text


@pytest.mark.parametrize("gravity", [0.0, -9.81])
def test_floor_above_the_ball(gravity):
    assert "`gravity`" in refusal(BouncingBall(gravity=gravity), ABOVE)


def test_parameter_that_is_not_a_number():
    text = refusal(BouncingBall(frequency=np.nan), ABOVE)
    assert "parameter" in text and "not finite" in text


def test_unknown_preset():
    with pytest.raises(ValueError, match="\"table-4.4\".*, not 'table-4.5'"):
        preset("table-4.5")


# --- release points


class Faller(HybridSystem):
    """A ball without a forcing period."""

    state_names: ClassVar[tuple[str, ...]] = ("height", "velocity")

    def vector_field(self, t, state):
        return jnp.stack([state[1], -jnp.ones_like(t)])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -0.5 * state[1]])


def test_no_release_point_without_a_period():
    assert "pass the state to start from" in refusal(Faller(), None)


def test_no_release_point_without_contact():
    class Riser(Faller):
        def vector_field(self, t, state):
            return jnp.stack([state[1], jnp.ones_like(t)])

        @property
        def period(self):
            return 1.0

    assert "there is no contact in the period" in refusal(Riser(), None)


# --- functions of the reader


def wrong(name, function):
    """`Faller` with one of its functions replaced."""
    return type("Wrong", (Faller,), {name: function})()


@pytest.mark.parametrize(
    "name, function, words",
    [
        ("vector_field", lambda s, t, x: x[1], "one rate for each component"),
        ("vector_field", lambda s, t, x: jnp.zeros(3), "one rate for each component"),
        ("gap", lambda s, t, x: x[:, None], "return a scalar or a vector of gaps"),
        ("gap", lambda s, t, x: x, "one row for each gap"),
        ("impact", lambda s, t, x: -x[1], "one row for each gap"),
        ("impact", lambda s, t, x: jnp.stack([x, x]), "one row for each gap"),
        ("gap", lambda s, t, x: x[0].astype(jnp.float32), "use 64-bit floats"),
        ("gap", lambda s, t, x: x[0] * jnp.nan, "the gap is not finite"),
        ("vector_field", lambda s, t, x: [x[1], -1.0], "vector_field returns a list"),
        ("gap", lambda s, t, x: [x[0]], "gap returns a list; return one array"),
        ("impact", lambda s, t, x: (x[0], -x[1]), "impact returns a tuple"),
        ("gap", lambda s, t, x: x[0] - np.cos(t), "jnp.cos, not np.cos"),
        ("gap", lambda s, t, x: x[0] - math.cos(t), "jnp.cos, not np.cos"),
        ("gap", lambda s, t, x: x[0] if t > 0 else x[0] + 1, "jnp.where instead"),
    ],
)
def test_functions_that_return_something_else(name, function, words):
    assert words in refusal(wrong(name, function), ABOVE)


class Driven(Faller):
    """A ball whose rates the reader passes as a function."""

    rates: Callable = lambda t, state: jnp.stack([state[1], -jnp.ones_like(t)])

    def vector_field(self, t, state):
        return self.rates(t, state)


def test_another_function_in_the_same_class_is_looked_at_too():
    """What was seen to fit is remembered; nothing else passes for it."""
    assert bool(simulate(Driven(), ABOVE, 0.0, 0.1).successful)
    scalar = Driven(lambda t, state: state[1])
    assert "one rate for each component" in refusal(scalar, ABOVE)
    assert "3 components" in refusal(Driven(), [1.0, 0.0, 0.0])


# --- what a trajectory is asked


@pytest.fixture(scope="module")
def trajectory():
    return simulate(BouncingBall(), ABOVE, 1.0, 2.0)


@pytest.mark.parametrize("times", [[0.9], [1.5, 2.1], [np.nan], [np.inf]])
def test_times_outside_of_the_trajectory(trajectory, times):
    with pytest.raises(ValueError, match="the trajectory covers 1 to 2 s"):
        trajectory.at(times)
    with pytest.raises(ValueError, match="the trajectory covers 1 to 2 s"):
        trajectory.gap(times)


def test_a_time_that_is_no_vector(trajectory):
    with pytest.raises(ValueError, match="pass a vector"):
        trajectory.at(1.5)


def test_stroboscope_without_a_period():
    falls = simulate(Faller(), ABOVE, 0.0, 1.0)
    with pytest.raises(ValueError, match=r"stroboscopic\(period=\.\.\.\)"):
        falls.stroboscopic()


# --- failures on the way are told in the result, not raised


def test_a_budget_that_runs_out():
    cut = simulate(BouncingBall(), ABOVE, 0.0, 5.0, max_steps=16)
    assert not bool(cut.successful)
    assert "raise max_steps" in cut.result


def test_a_field_that_stops_being_a_number():
    class Rooted(Faller):
        def vector_field(self, t, state):
            # no number beyond t = 0.5
            return jnp.stack([state[1], -jnp.sqrt(0.5 - t)])

    blown = simulate(Rooted(), ABOVE, 0.0, 2.0)
    assert not bool(blown.successful)
    assert blown.result != ""
    assert 0.4 < float(blown.steps.time[-1]) <= 0.5
    assert np.all(np.isfinite(np.asarray(blown.steps.state)))


def test_bad_states_inside_of_jit_are_told_by_the_code():
    def code(state):
        return simulate(BouncingBall(), state, 0.0, 1.0, max_steps=256).code

    codes = jax.jit(jax.vmap(code))(jnp.array([ABOVE, [np.nan, 0.0]]))
    assert codes.tolist() == [0, 3]
