"""The cam-follower: one impact a turn, its cascade, and the orbit that sticks."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import continuation
from jaxcam.hybrid import stroboscope
from jaxcam.hybrid.surface import contact_acceleration
from jaxcam.models import preset, rad_s_to_rpm, rpm_to_rad_s


# of the orbit with one impact a turn at 145 rpm, from a simulation
SEED = np.array([0.4245, 1.828])


def speed(system):
    return system.speed


def rig(rpm):
    system = preset("calibrated")
    return eqx.tree_at(speed, system, jnp.asarray(rpm_to_rad_s(rpm)))


def bounds(low, high):
    return rpm_to_rad_s(low), rpm_to_rad_s(high)


def detachment():
    """rpm at which the largest acceleration that contact suppresses is zero."""

    def largest(rpm):
        system, middle, width = rig(rpm), 0.5, 1.0
        for _ in range(2):
            phase = middle + width * np.linspace(-0.5, 0.5, 2001)
            time = jnp.asarray(phase * float(system.period))
            values = contact_acceleration(system, time, jnp.asarray(SEED))
            middle, width = phase[int(jnp.argmax(values))], 2e-3
        return float(jnp.max(values))

    return float(brentq(largest, 120.0, 130.0, xtol=1e-9))  # pyright: ignore


def one_impact(rpm=145.0):
    return continuation.periodic_orbits(rig(rpm), SEED, periods=1)


@pytest.mark.slow
def test_fold_and_flip_of_one_impact_a_turn():
    start = one_impact()
    branch = continuation.branch(
        start.problem, start, speed, bounds(130.0, 154.0), direction="both"
    )
    found = {point.kind: point for point in branch.special}
    assert all(point.converged for point in branch.special)
    assert abs(rad_s_to_rpm(found["fold"].parameter) - 135.947) < 0.01
    assert 151.8 < rad_s_to_rpm(found["flip"].parameter) < 151.9
    for point in branch.regular:
        # flight is conservative, so the multipliers' product is r^2
        system = point.problem.parameters  # pyright: ignore
        r = float(system.restitution(system.speed, jnp.asarray(0.0)))
        assert np.prod(point.multipliers).real == pytest.approx(r * r, rel=1e-8)
    stable = [p for p in branch.regular if p.stable]
    assert stable and len(stable) < len(branch.regular)
    # the motion itself, brought near each stable orbit, settles on it
    chosen = stable[:: max(1, len(stable) // 8)]
    chosen = [p for p in chosen if np.max(np.abs(p.multipliers)) < 0.8]
    run = stroboscope(
        rig(145.0),
        np.array([p.observed["stroboscopic"][0] + 1e-4 for p in chosen]),
        150,
        where=speed,
        values=[p.parameter for p in chosen],
    )
    for k, point in enumerate(chosen):
        np.testing.assert_allclose(
            run.states[k, -1], point.observed["stroboscopic"][0], atol=1e-7
        )


@pytest.mark.slow
def test_second_corrector_finds_the_same_branch():
    start = one_impact(150.0)
    flips = []
    for algorithm in (continuation.PseudoArclength(), continuation.MoorePenrose()):
        for point in continuation.follow(
            start.problem, start, speed, bounds(149.0, 153.0), algorithm
        ):
            if point.kind == "flip":
                flips.append(point)
                break
    first, second = flips
    assert abs(first.parameter - second.parameter) < 1e-10
    np.testing.assert_allclose(first.state, second.state, atol=1e-9)


@pytest.mark.slow
def test_cascade_with_the_ratio_of_feigenbaum():
    start = one_impact()
    found = continuation.cascade(
        start.problem,
        start,
        speed,
        bounds(140.0, 160.0),
        flips=5,
    )
    assert len(found.flips) == 5 and all(p.converged for p in found.flips)
    assert [len(p.state) for p in found.flips] == [3, 6, 12, 24, 48]
    assert abs(found.ratios[-1] / 4.669201609 - 1) < 0.01


@pytest.mark.slow
def test_orbit_that_sticks_from_its_beginning_to_its_interruption():
    system = rig(145.0)
    start = continuation.periodic_orbits(system, continuation.periodic_orbit(system))
    branch = continuation.branch(
        start.problem, start, speed, bounds(115.0, 160.0), direction="both"
    )
    first, last = branch.special
    assert first.kind == "detachment" and first.converged
    assert abs(rad_s_to_rpm(first.parameter) - detachment()) < 1e-6
    assert last.kind == "interruption of chatter" and last.converged
    assert abs(rad_s_to_rpm(last.parameter) - 152.67658) < 0.04
    direct = continuation.chatter_interruption(system, speed, bounds(150.0, 155.0))
    assert abs(float(direct) - last.parameter) < 1e-9
    times = [float(p.observed["sticking time"]) for p in branch.regular]
    assert min(times) > 0


@pytest.mark.slow
def test_family_of_period_three():
    # Figure 5.12; the seed is where one motion in seven of a sweep at 155.25 rpm ends
    seed = np.array([0.47075613, 2.29945954])
    start = continuation.periodic_orbits(rig(155.25), seed, periods=3)
    assert start.problem.periods == 3  # pyright: ignore
    ends = {}
    for direction in (-1, 1):
        for point in continuation.follow(
            start.problem, start, speed, bounds(150.0, 160.0), direction=direction
        ):
            if point.special:
                ends[direction] = point
                break
    fold, flip = ends[-1], ends[1]
    assert (fold.kind, flip.kind) == ("fold", "flip")
    assert fold.converged and flip.converged
    print("fold", rad_s_to_rpm(fold.parameter), "flip", rad_s_to_rpm(flip.parameter))
    assert 154.75 < rad_s_to_rpm(fold.parameter) < 155.25
    # the thesis has its doubling, P(6, 6), at 156 rpm
    assert 155.75 < rad_s_to_rpm(flip.parameter) < 156.0
    assert flip.criticality == "supercritical"
