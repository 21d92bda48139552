"""Models whose errors are so large that the diagnosis allows for them."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from swing_rig import PARAMETERS, Swing

from jaxcam.discrepancy import diagnose, library, Policy, Verdict
from jaxcam.discrepancy._answer import _again
from jaxcam.discrepancy.evidence._visited_states import visited_states
from jaxcam.discrepancy.report import Reason
from jaxcam.discrepancy.search import (
    KeptTrials,
    model_errors_dominate,
    system_question,
    Trials,
    with_model_error,
)
from jaxcam.discrepancy.search._blocks import _diverging, blocks_of
from jaxcam.fitting import fit, Sensor
from jaxcam.fitting.engine import allowing, JOINT, separated
from jaxcam.recordings import Recording, segment


_TIME = 5e-3 * np.arange(1600)
_NOISE = 1e-7


def _segments(force, noise=_NOISE):
    """Two free oscillations with an additional force, integrated with scipy."""
    rng, parts = np.random.default_rng(2), []
    for k, start in enumerate((0.3, 0.2)):
        found = solve_ivp(
            lambda t, y: [y[1], -150.0 * y[0] - 0.1 * y[1] + force(*y)],
            (0, _TIME[-1]),
            [start, 0.0],
            "DOP853",
            _TIME,
            rtol=1e-11,
            atol=1e-13,
        )
        angle = found.y[0] + noise * rng.standard_normal(len(_TIME))
        run = Recording(f"run{k}", _TIME, {"angle_rad": angle})
        parts.append(segment(run, "angle_rad", noise=noise))
    return parts


def _bumps(position, velocity):
    """A force that no term of the library describes."""
    return 2.0 * math.sin(60 * position) * math.cos(3 * velocity)


def _terms(*names):
    return [term for term in library(turned=False) if term.name in names]


def _silent(sentence, fraction):
    pass


def _question(parts, noise=_NOISE):
    return system_question(
        Swing(),
        tuple(parts),
        _terms("nonlinear_spring"),
        {"angle_rad": Sensor(0, noise=noise)},
        PARAMETERS,
        None,
        _silent,
        Policy(),
    )


@pytest.fixture(scope="module")
def question():
    return _question(_segments(_bumps))


def test_joints_that_allow_for_errors_keep_their_proportions(question):
    """Errors scale with a single piece; to separate pieces never tightens a joint."""
    given = question.problem.extras
    one = given.sharpness
    for part in (0.02, 30.0):
        found = allowing(given, part)
        new, apart = found.sharpness, separated(found).sharpness
        np.testing.assert_allclose(new.flight, part * one.piece)
        np.testing.assert_allclose(new.impact, part / JOINT * one.impact)
        np.testing.assert_allclose(apart.flight, max(part, 1.0) * one.piece)
        np.testing.assert_allclose(apart.impact, max(part, 1.0) / JOINT * one.impact)
        again = allowing(found, JOINT).sharpness
        np.testing.assert_allclose(again.impact, max(part, 1.0) * one.impact)
        # complete flights are as tight as before, whatever was allowed
        tight = allowing(found, JOINT / max(part, 1.0)).sharpness
        np.testing.assert_allclose(tight.flight, JOINT * one.piece)
        np.testing.assert_allclose(tight.impact, one.impact)
    np.testing.assert_allclose(
        separated(given).sharpness.gap, allowing(given, 1.0).sharpness.gap
    )


def test_noise_and_joints_are_as_large_as_the_errors(question):
    """The noise is `resolved` times the residual, and a component of a joint costs as
    much as a sample, within a factor of three: the fit of a problem with larger noise
    is another one."""
    policy = Policy()
    bare = fit(question.problem, free=question.rig)
    assert model_errors_dominate(bare, bare, policy)
    # a term that leaves little of the misfit is named, however small the noise is
    assert not model_errors_dominate(
        bare, dataclasses.replace(bare, cost=0.02 * bare.cost), policy
    )
    found = with_model_error(question, policy)
    assert found is not None
    (one,) = found.model_errors
    before = float(question.problem.model.sensors["angle_rad"].floor)
    assert one.channel == "angle_rad" and one.stated == pytest.approx(before)
    assert one.used == pytest.approx(policy.resolved * one.residual)
    floor = float(found.problem.model.sensors["angle_rad"].floor)
    assert floor == pytest.approx(one.used)
    problem = found.problem
    best = fit(
        problem, free=question.rig, start=problem.start, stop=lambda costs: False
    )
    joints = int(np.sum(np.asarray(problem.pieces.joint) > 0))
    cost = np.sum(best.costs.joints) / (2 * joints)
    samples = np.sum(best.costs.flown) / problem.samples
    assert 1 / 3 < cost / samples < 3
    assert math.sqrt(samples) == pytest.approx(1 / policy.resolved, rel=0.2)


def test_terms_found_with_larger_noise_are_fitted_with_the_stated_one(question):
    """The number of pieces in the arrays differs: only the values are passed on."""
    policy = Policy()
    rough = with_model_error(question, policy)
    assert rough is not None
    names, trials = frozenset({"nonlinear_spring"}), []
    for one in (rough, question):
        every = one.problem, one.rig, one.terms, policy, _silent
        trials.append(Trials(*every))
    first = trials[0].attempt(names, trials[0].attempt(frozenset(), None))
    bare = trials[1].attempt(frozenset(), None)
    again = _again(trials[1], first.names, first.fit)
    assert again.names == names and again.fit.cost < bare.fit.cost
    assert again.fit.point.states.shape == question.problem.start.states.shape


def test_flights_of_one_piece_have_no_joints_to_loosen():
    """Recordings shorter than a piece: the noise is raised, nothing fails."""
    parts = []
    for part in _segments(_bumps):
        run = part.recording
        short = Recording(run.name, run.time[:40], {"angle_rad": run["angle_rad"][:40]})
        parts.append(segment(short, "angle_rad", noise=_NOISE))
    short = _question(parts)
    assert not np.any(np.asarray(short.problem.pieces.joint))
    found = with_model_error(short, Policy())
    assert found is not None and found.looseness == 1.0
    assert found.model_errors[0].residual > 10 * _NOISE


def test_errors_that_single_pieces_do_not_show_are_not_allowed_for():
    """The model has all of the physics: single pieces leave only the noise."""
    parts = _segments(lambda x, v: 0.0)
    assert with_model_error(_question(parts), Policy()) is None


def test_only_pieces_with_diverging_derivatives_are_left_out(question):
    """Joints add a million times the information of a piece; one diverging piece, or
    one that is not finite, is left out alone."""
    problem = question.problem
    sharp = problem.extras.sharpness
    usual = 1 / np.asarray(sharp.piece) ** 2 + 2 / np.asarray(sharp.flight) ** 2
    ss = np.einsum("rkn,nm->rknm", usual, np.eye(usual.shape[-1]))
    assert not np.any(_diverging(problem, ss))
    for wrong in (1e8, np.nan):
        bad = ss.copy()
        bad[0, 3] *= wrong
        found = _diverging(problem, bad)
        assert found[0, 3] and np.sum(found) == 1
    blocks = blocks_of(problem, problem.start, 2)
    assert np.all(np.abs(blocks.information).max((1, 2)) > 0)


def test_recordings_may_begin_at_any_time(question):
    """Sections and ranges of the time follow the recordings: the same information."""
    parts = []
    for part in question.problem.segments:
        run = part.recording
        late = Recording(run.name, run.time + 100.0, dict(run.channels))
        parts.append(segment(late, "angle_rad", noise=_NOISE))
    late = _question(parts).problem
    both = [blocks_of(one, one.start, 4) for one in (question.problem, late)]
    first, shifted = (blocks.information for blocks in both)
    np.testing.assert_allclose(shifted, first, rtol=1e-6, atol=1e-6 * first.max())
    assert visited_states(late).times == pytest.approx((100.0, 100.0 + _TIME[-1]))


def test_a_search_with_more_time_continues_with_the_same_fits(question, tmp_path):
    few, many = (
        KeptTrials(tmp_path, question.problem, Policy(minutes=m)) for m in (5.0, 60.0)
    )
    other = KeptTrials(tmp_path, question.problem, Policy(confidence=0.8))
    assert few.mark == many.mark != other.mark


@pytest.mark.slow
def test_physics_that_is_found_is_fitted_with_the_stated_noise():
    """Quadratic drag: 1000 times the noise without it, only noise with it."""
    found = diagnose(
        Swing(),
        _segments(lambda x, v: -0.05 * abs(v) * v),
        _terms("quadratic_drag", "nonlinear_spring"),
        sensors={"angle_rad": Sensor(0, noise=_NOISE)},
        parameters=list(PARAMETERS),
    )
    assert found.verdict is Verdict.EFFECT and found.names == ("quadratic_drag",)
    assert found.heldout_before > 100 * _NOISE
    assert found.heldout_after < 1.2 * _NOISE
    assert Reason.MODEL_ERROR not in {one.reason for one in found.caveats}


@pytest.mark.slow
def test_a_model_that_stays_far_off_says_so():
    """The caveats give the residuals on single pieces and over complete flights."""
    found = diagnose(
        Swing(),
        _segments(_bumps),
        _terms("nonlinear_spring"),
        sensors={"angle_rad": Sensor(0, noise=_NOISE)},
        parameters=list(PARAMETERS),
        policy=dataclasses.replace(Policy(), functions=0),
    )
    assert found.verdict is Verdict.UNKNOWN
    assert found.noise_floor > 10 * _NOISE
    said = [str(one) for one in found.caveats if one.reason is Reason.MODEL_ERROR]
    assert "single pieces" in said[0] and "complete flights" in said[1]
