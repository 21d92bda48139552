"""Periodic orbits with switching surfaces: found, their multipliers, and followed."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import continuation
import variational
from jaxcam import simulate
from jaxcam.hybrid import flow, Settings, SwitchedSystem
from jaxcam.models import BilinearOscillator, DryFrictionOscillator


EXACT = Settings(tolerance=1e-12)


class Belt(SwitchedSystem):
    """A block on a belt, held by a spring; it sticks until the spring pulls `static`
    times as hard as kinetic friction.
    """

    friction: float = 0.4
    belt: float = 0.3
    static: float = 1.5

    def switching(self, t, state):
        return state[1] - self.belt

    def branch(self, t, state, sides):
        return jnp.stack([state[1], -state[0] - self.friction * sides[0]])

    @property
    def holding(self):
        return self.static


def stick_slip(belt: float) -> float:
    """Period of the cycle: an arc about the kinetic friction, then a straight line."""
    excess = 0.4 * 0.5
    return 2 * np.pi - 2 * np.arctan(excess / belt) + 2 * excess / belt


@functools.cache
def belt_cycle():
    return continuation.periodic_orbit(Belt(), [0.4, 0.3], 6.0)


def test_the_stick_slip_cycle_has_its_period_and_multipliers():
    """Period to 1e-9; what sticking forgets is a zero multiplier, the other is 1."""
    orbit = belt_cycle()
    assert float(orbit.period) == pytest.approx(stick_slip(0.3), abs=1e-9)
    assert [event.kind for event in orbit.signature] == ["leave", "slide"]
    found = np.sort(np.abs(np.asarray(orbit.multipliers)))
    np.testing.assert_allclose(found, [0.0, 1.0], atol=1e-7)
    again = variational.floquet_multipliers(Belt(), orbit)
    np.testing.assert_allclose(np.sort(np.abs(again)), found, atol=1e-12)


def test_an_orbit_that_is_traversed_twice_has_equal_halves():
    """To 1e-8; the halves of the cycle itself differ by half its size. Orbits that
    repeat after an odd number of forcing periods have no halves to compare.
    """
    orbit = belt_cycle()
    start = continuation.SingleShooting.of(Belt(), orbit, 0, EXACT)
    half_away = start.problem.representation.half_away
    twice = np.append(start.state[:-1], 2 * start.state[-1])
    once = half_away(start.state, Belt())
    assert once is not None and once > 0.5
    assert half_away(twice, Belt()) < 1e-8
    forced = continuation.SingleShooting.of(
        BilinearOscillator(), belt_cycle(), 1, EXACT
    )
    representation = forced.problem.representation
    assert representation.half_away(forced.state, BilinearOscillator()) is None


@pytest.mark.slow
def test_a_branch_of_stick_slip_cycles_has_the_period_of_the_closed_form():
    """From a belt speed of 0.3 to 0.6, all periods to 1e-8."""
    found = continuation.branch(Belt(), belt_cycle(), "belt", (0.3, 0.6))
    assert float(found.points[-1].parameter) == pytest.approx(0.6)
    for point in found.points:
        period = float(point.observed["period"])
        assert period == pytest.approx(stick_slip(float(point.parameter)), abs=1e-8)
        np.testing.assert_allclose(point.multipliers, 0.0, atol=1e-7)


def amplitude(omega: float, friction: float) -> float:
    """Amplitude without sticking (Den Hartog, Trans. ASME 53, 1931)."""
    static = 1 / (1 - omega**2)
    lost = np.sin(np.pi / omega) / (omega * (1 + np.cos(np.pi / omega)))
    return float(np.sqrt(static**2 - (friction * lost) ** 2))


@functools.cache
def rubbed():
    return continuation.periodic_orbit(DryFrictionOscillator(omega=0.7, friction=0.2))


def test_the_amplitude_with_dry_friction_is_den_hartogs():
    """Positions of both reversals, to 1e-9; the motion repeats, to 1e-9."""
    orbit = rubbed()
    turned = np.asarray(orbit.switches.after)[:2, 0]
    size = amplitude(0.7, 0.2)
    np.testing.assert_allclose(np.sort(turned), [-size, size], atol=1e-9)
    assert [event.kind for event in orbit.signature] == ["cross", "cross"]
    assert float(orbit.closure) < 1e-9


@pytest.mark.slow
def test_the_multipliers_with_dry_friction_are_those_of_differences():
    """The monodromy matrix is that of central differences of the flow, to 1e-6."""
    orbit, step = rubbed(), 1e-5
    system = DryFrictionOscillator(omega=0.7, friction=0.2)

    def after(x):
        end = orbit.time + orbit.period
        return flow(system, x, orbit.time, end, settings=EXACT).state

    aside = step * jnp.eye(2)
    moved = jax.vmap(after)(orbit.state[None] + aside)
    other = jax.vmap(after)(orbit.state[None] - aside)
    slopes = (moved - other).T / (2 * step)
    np.testing.assert_allclose(orbit.monodromy, slopes, atol=1e-6)
    assert orbit.stable


@pytest.mark.slow
def test_a_branch_goes_on_where_the_motion_begins_to_stick():
    """Friction from 0.2 to 0.9: Den Hartog's amplitude until the mass sticks, then the
    orbit to which simulations converge, to 1e-8.
    """
    start = DryFrictionOscillator(omega=0.7, friction=0.2)
    found = continuation.branch(start, rubbed(), "friction", (0.2, 0.9))
    assert float(found.points[-1].parameter) == pytest.approx(0.9)
    sticks = []
    for point in found.points:
        friction = float(point.parameter)
        system = DryFrictionOscillator(omega=0.7, friction=friction)
        time = float(point.observed["time"])
        run = simulate(
            system,
            point.state,
            time,
            time + float(point.observed["period"]),
            settings=EXACT,
        )
        np.testing.assert_allclose(run.final, point.state, atol=1e-8)
        kinds = np.asarray(run.switches.kind)[: int(run.switches.count)]
        sticks.append(bool(np.any(kinds == 1)))
        if not sticks[-1]:
            turned = np.abs(np.asarray(run.switches.after)[:2, 0])
            np.testing.assert_allclose(turned, amplitude(0.7, friction), atol=1e-8)
    assert not sticks[0] and sticks[-1]


@pytest.mark.slow
def test_orbits_of_a_bilinear_oscillator_double_their_period():
    """A flip on the branch, and the branch of twice the period beyond it returns only
    after both turns.
    """
    system = BilinearOscillator(stiffness=8.0, omega=1.7, amplitude=1.0, damping=0.05)
    orbit = continuation.periodic_orbit(system)
    found = continuation.branch(system, orbit, "omega", (1.7, 2.6))
    flips = [p for p in found.special if p.kind == "flip"]
    assert flips
    (twice,) = continuation.switch(flips[0], "omega", (1.7, 2.6))
    last = twice.points[-1]
    omega = float(last.parameter)
    assert float(last.observed["period"]) == pytest.approx(4 * np.pi / omega)
    system = BilinearOscillator(stiffness=8.0, omega=omega, amplitude=1.0, damping=0.05)
    times = float(last.observed["time"]) + 2 * np.pi / omega * np.arange(3)
    run = simulate(system, last.state, times[0], times[2], settings=EXACT)
    once, both = (np.asarray(run.at([t])[0]) for t in times[1:])
    np.testing.assert_allclose(both, last.state, atol=1e-8)
    assert np.max(np.abs(once - last.state)) > 1e-3
