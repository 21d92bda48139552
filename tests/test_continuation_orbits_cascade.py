"""From one impact a period to complete chatter: grazing bifurcations that accumulate,
and compiled programs that serve any number of impacts.

Truth: a simulation, the interruption computed by itself, the wall at -1 that the
forcing can never lift the mass from.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from test_continuation_orbits_walls import Walls

import continuation
import variational
from continuation import BranchSettings
from continuation._context import Context
from continuation._program import correct
from jaxcam.models import ImpactOscillator
from jaxcam.parameters import as_arrays


OMEGA = 2.0


def oscillator(wall):
    return ImpactOscillator(wall=wall, omega=OMEGA)


@pytest.fixture(scope="module")
def cascade():
    system = as_arrays(oscillator(-0.04))
    return continuation.branch(system, None, "wall", (-1.2, 0.0), direction=-1)


def impacts(point):
    return len(point.problem.constraints)


def test_every_grazing_adds_one_impact(cascade):
    """Eight in a row, at walls ever closer to each other."""
    grazings = cascade.of_kind("grazing")
    assert [impacts(point) for point in grazings] == list(range(1, 9))
    assert np.all(np.diff([p.parameter for p in grazings], 2) > 0)


def test_a_stable_orbit_with_five_impacts_is_that_of_a_simulation(cascade):
    """Period and impacts of the event loop; states to 1e-8."""
    five = [p for p in cascade.points if p.signature.startswith("impacts 0.0.0.0.0 ")]
    point = next(p for p in five if p.stable)
    system = oscillator(point.parameter)
    observed = point.observed
    orbit = variational.orbit_of(
        system,
        observed["stroboscopic"][0],
        float(observed["period"]),
        0.0,
    )
    assert int(orbit.impacts.count) == 5
    after = np.asarray(orbit.impacts.after)
    rows = point.state.reshape(5, 3)
    order = np.argsort(np.mod(rows[:, 0], 1.0))
    assert np.max(np.abs(after - rows[order, 1:])) < 1e-8


def test_the_cascade_ends_at_the_interruption_of_chatter(cascade):
    """It is where the chatter theory puts it, to 1e-12, and the sticking orbit beyond
    ends where the wall is at -1, beyond which the forcing cannot lift the mass.
    """
    (point,) = cascade.of_kind("interruption of chatter")
    wall = variational.chatter_interruption(oscillator(0.0), "wall", (-0.85, -0.8))
    assert abs(point.parameter - float(wall)) < 1e-12
    assert "accumulate here" in point.reason
    (detached,) = cascade.of_kind("detachment")
    assert abs(detached.parameter + 1.0) < 1e-9
    between = [p for p in cascade.points if point.label < p.label < detached.label]
    assert between and all(p.stable for p in between)


def test_a_branch_goes_on_from_a_point_of_the_cascade(cascade):
    """The points behind the interruption, and those with three impacts, again."""
    sticking = [p for p in cascade.points if p.signature.startswith("sticks")]
    third = [p for p in cascade.points if p.signature.startswith("impacts 0.0.0 ")]
    start = cascade.points[0]
    for point in (sticking[2], third[2]):
        again = continuation.follow(
            start.problem,
            point,
            "wall",
            (-1.2, 0.0),
            history=cascade.points[: point.label],
        )
        following = next(p for p in again)
        (known,) = (p for p in cascade.points if p.label == following.label)
        assert following.parameter == known.parameter
        assert np.array_equal(following.state, known.state)


@pytest.mark.parametrize("restitution", [0.2, 0.3])
def test_a_cascade_at_low_restitution_reaches_chatter_too(restitution):
    """Its grazing bifurcations approach each other fast; the interruption to 1e-12."""
    system = ImpactOscillator(wall=-0.04, omega=OMEGA, restitution=restitution)
    found = continuation.branch(
        as_arrays(system), None, "wall", (-1.2, 0.0), direction=-1
    )
    (point,) = found.of_kind("interruption of chatter")
    near = (point.parameter - 1e-3, point.parameter + 1e-3)
    wall = variational.chatter_interruption(system, "wall", near)
    assert abs(point.parameter - float(wall)) < 1e-12
    assert len(found.of_kind("grazing")) == 5
    (detached,) = found.of_kind("detachment")
    assert abs(detached.parameter + 1.0) < 1e-9


def test_orbits_that_stick_are_no_part_of_an_accumulation(cascade):
    """Behind an interruption, the impacts of a branch become fewer."""
    grazings = cascade.of_kind("grazing")
    (point,) = cascade.of_kind("interruption of chatter")
    problem = grazings[0].problem
    assert problem.accumulation(grazings) is not None
    assert problem.accumulation([point, *grazings[:5]]) is None
    assert problem.accumulation([*grazings[:4], point]) is None
    assert problem.accumulation(grazings[::-1]) is None


def test_an_interruption_beyond_the_bounds_does_not_end_the_branch(cascade):
    """The next grazing bifurcation adds an impact, as if nothing accumulated."""
    eight = [p for p in cascade.points if p.signature.count("0.") == 7]
    last = [p for p in eight if p.kind == "regular"][-1]
    again = continuation.follow(
        cascade.points[0].problem,
        last,
        "wall",
        (-0.8, 0.0),
        history=cascade.points[: last.label],
    )
    grazing, following = next(again), next(again)
    assert grazing.kind == "grazing"
    assert impacts(following) == 9


class Viscous(ImpactOscillator):
    """The restitution is not defined for a motion away from the wall."""

    def impact(self, t, state):
        factor = 1.0 - 0.2 * jnp.power(state[1], 0.2)
        return jnp.stack([state[0], -factor * state[1]])


def once(system):
    guess = np.array([-0.6, 0.8]) if isinstance(system, Viscous) else None
    return continuation.periodic_orbits(system, guess)


def twice(system):
    """The orbit as one of two periods."""
    start = once(system)
    problem = continuation.ImpactingOrbits(system, (0, 0), 2, 2, start.problem.steps)
    later = start.state + np.array([1.0, 0.0, 0.0])
    return continuation.Start(problem, np.concatenate([start.state, later]))


@pytest.mark.parametrize(
    ("system", "represented"),
    [
        (Walls(), once),
        (oscillator(-0.04), once),
        (oscillator(-0.04), twice),
        (Viscous(wall=-0.04, omega=OMEGA), once),
    ],
)
def test_padding_does_not_change_an_orbit(system, represented, monkeypatch):
    """An orbit and its derivatives with 16 rows of unknowns, and with one for each
    impact, to 1e-10.
    """
    start = represented(as_arrays(system))
    z = np.append(start.state, float(system.omega))
    context = Context(0, 1.0, BranchSettings())
    across = np.append(np.zeros_like(start.state), 1.0)
    assert start.problem.padded().size == 16 * 3
    wide = correct(start.problem, context, z, across, across)
    monkeypatch.setattr(continuation.ImpactingOrbits, "padded", lambda self: None)
    exact = correct(start.problem, context, z, across, across)
    assert wide.success and exact.success
    for name in ("z", "jacobian", "linearisation", "tangent", "determinant", "scale"):
        a, b = getattr(wide, name), getattr(exact, name)
        assert np.max(np.abs(a - b)) < 1e-10 * (1 + np.max(np.abs(b))), name
    strobe = [at.observed["stroboscopic"] for at in (wide, exact)]
    np.testing.assert_allclose(*strobe, rtol=0, atol=1e-10)
    assert wide.monitors.keys() == exact.monitors.keys()
    for name, value in exact.monitors.items():
        assert abs(wide.monitors[name] - value) < 1e-10, name
