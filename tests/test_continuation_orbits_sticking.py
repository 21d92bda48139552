"""Orbits that stick, every period or every second one, and what lies behind them."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import continuation
import jaxcam
from jaxcam.models import ImpactOscillator, preset, rad_s_to_rpm, rpm_to_rad_s
from jaxcam.parameters import as_arrays


# compiling takes most of the time
pytestmark = pytest.mark.slow


def omega(system):
    return system.omega


def speed(system):
    return system.speed


def oscillator(w, r):
    return as_arrays(ImpactOscillator(omega=w, restitution=r))


def rig(rpm):
    system = eqx.tree_at(speed, preset("calibrated"), jnp.asarray(rpm_to_rad_s(rpm)))
    return as_arrays(system)


def simulated_periods(system, turns):
    """Periods from one release to the next, of the motion that starts at release."""
    period = float(system.period)
    run = jaxcam.simulate(system, None, 0.0, turns * period)
    ends = np.asarray(run.contacts.end)[: int(run.contacts.count)]
    return np.diff(ends) / period


def test_sticks_every_second_period_between_two_interruptions():
    system = oscillator(3.1, 0.3)
    orbit = continuation.periodic_orbit(system, periods=2)
    assert orbit.sticks
    start = continuation.periodic_orbits(system, orbit)
    np.testing.assert_allclose(simulated_periods(system, 21), 2.0, rtol=1e-9)
    ends = {}
    for direction in (-1, 1):
        points = []
        for point in continuation.follow(
            start.problem, start, omega, (2.5, 3.5), direction=direction,
            settings=continuation.BranchSettings(max_step=0.02),
        ):  # fmt: skip
            points.append(point)
            if point.special or len(points) > 100:
                break
        ends[direction] = points[-1]
        for point in points[:-1]:
            assert point.signature == "sticks once in 2 periods"
            assert float(point.observed["sticking time"]) > 0
    for point, bracket in ((ends[-1], (2.96, 2.99)), (ends[1], (3.19, 3.24))):
        assert point.kind == "interruption of chatter" and point.converged
        direct = continuation.chatter_interruption(system, omega, bracket, periods=2)
        assert abs(float(direct) - point.parameter) < 1e-9


def test_branch_goes_on_behind_the_interruption_with_ever_fewer_impacts():
    start = continuation.periodic_orbits(oscillator(0.55, 0.5), beyond=True)
    points, later = [], 0
    for point in continuation.follow(start.problem, start, omega, (0.5, 0.8)):
        points.append(point)
        later += any(p.kind == "grazing" for p in points)
        if later > 4 or len(points) > 100:
            break
    special = [point for point in points if point.special]
    kinds = ["interruption of chatter", "fold", "grazing"]
    assert [p.kind for p in special] == kinds
    assert all(p.converged for p in special)
    (taken,) = [p for p in points if "continued with" in p.reason]
    # close behind the interruption, not at it
    assert 0 < taken.parameter - special[0].parameter < 0.01
    behind = points[points.index(taken) :]
    counts = [len(_orbits(p).constraints) for p in behind]
    # at the grazing one impact is lost
    assert counts[0] == counts[-1] + 1 and set(counts) == {counts[0], counts[-1]}
    stable = [p for p in behind if p.stable]
    best = min(stable, key=lambda p: np.max(np.abs(p.multipliers)))
    # the motion, left to itself, stays on the stable orbit with as many impacts
    orbits = _orbits(best)
    system, period = orbits.parameters, float(best.observed["period"])
    begin = best.observed["stroboscopic"][0]
    run = jaxcam.simulate(system, begin, 0.0, 30 * period)
    assert int(run.contacts.count) == 0
    assert int(run.impacts.count) == 30 * len(orbits.constraints)
    np.testing.assert_allclose(run.final, begin, atol=1e-7)


def _orbits(point) -> Any:
    return point.problem


def test_cam_follower_sticks_every_third_period():
    system = rig(153.6)
    np.testing.assert_allclose(simulated_periods(system, 31), 3.0, rtol=1e-8)
    orbit = continuation.periodic_orbit(system, periods=3)
    start = continuation.periodic_orbits(system, orbit)
    bounds = rpm_to_rad_s(153.5), rpm_to_rad_s(153.7)
    for direction in (-1, 1):
        point = None
        for point in continuation.follow(
            start.problem, start, speed, bounds, direction=direction
        ):
            if point.special:
                break
        assert point is not None and point.kind == "interruption of chatter"
        assert point.converged
        inside = 1e-3 * direction
        rpm = float(rad_s_to_rpm(point.parameter))
        periods = simulated_periods(rig(rpm - inside), 31)
        np.testing.assert_allclose(periods, 3.0, rtol=1e-6)
        outside = simulated_periods(rig(rpm + inside), 31)
        assert len(outside) == 0 or abs(outside[0] - 3.0) > 0.5


def test_curve_of_interruptions_in_frequency_and_restitution():
    start = continuation.periodic_orbits(oscillator(0.59, 0.5))
    for point in continuation.follow(start.problem, start, omega, (0.5, 0.61)):
        if point.special:
            break
    curve = continuation.curve(
        point, (omega, lambda s: s.restitution), ((0.2, 2.0), (0.3, 0.7))
    )
    assert curve.points[0].parameters[1] == 0.3
    assert curve.points[-1].parameters[1] == 0.7
    for point in curve.points[::6]:
        w, r = point.parameters
        bracket = (0.95 * w, 1.05 * w)
        direct = continuation.chatter_interruption(oscillator(w, r), omega, bracket)
        assert abs(float(direct) - w) < 1e-10
