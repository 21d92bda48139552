"""Fits of a rig of which everything is known, simulated by another engine."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from fitting_rigs import assert_inside, cam_problem, NOMINAL, recorded, TRUTH

from jaxcam import fitting
from jaxcam.fitting.engine._linearise import assemble, cost_of
from jaxcam.recordings import mend, RecordingError, segment, segment_case


@pytest.fixture(scope="module")
def problem():
    return cam_problem(recorded())


@pytest.fixture(scope="module")
def found(problem):
    return fitting.fit(problem)


def test_the_truth_is_inside_the_errors(found):
    assert found.converged
    assert_inside(found)


def test_residuals_are_white_noise(found):
    for part in fitting.residuals(found):
        assert part.rms == pytest.approx(part.noise, rel=0.04)
        count = len(part.value)
        assert np.max(np.abs(part.autocorrelation())) < 4.5 / np.sqrt(count)


def test_the_cost_at_the_truth_is_no_better(problem, found):
    """Twice the log-likelihood falls by a chi-square of as many parameters."""
    best = fitting.fit(problem, prior=False, start=found)
    truth = fitting.fit(problem, free=(), start=TRUTH, prior=False)
    assert 0 < truth.cost - best.cost < 30


def test_scores_are_derivatives(problem, found):
    """Scores of the parameters and states against central differences of the cost."""
    columns = problem.layout.places
    names = problem.names
    scale = np.array([problem.parameter(n).tolerance for n in names])
    records = len(problem.records)
    width = -(-len(columns) // 4) * 4
    local = np.tile(
        np.append(np.arange(len(names)), np.zeros(width - len(names), int)),
        (records, 1),
    )
    scales = np.tile(np.append(scale, np.zeros(width - len(names))), (records, 1))
    # off the optimum, where scores are large
    values = found.point.values + 1e-4 * scale[None]
    point = found.point._replace(values=values)
    blocks, _ = assemble(
        problem.layout,
        problem.pieces,
        problem.extras,
        point,
        jnp.asarray(local),
        jnp.asarray(scales),
    )

    def cost(point):
        costs = cost_of(problem.layout, problem.pieces, problem.extras, point)
        exists, rests = problem.pieces.exists, problem.pieces.rest_exists
        return float(
            jnp.sum(jnp.where(exists, costs.flown + costs.joints, 0.0))
            + jnp.sum(jnp.where(rests, costs.rested, 0.0))
        )

    for k in range(len(names)):
        # the cost is a sum of 1e4 terms: a step that is large beside its rounding
        h = 1e-6
        ends = [
            cost(point._replace(values=values.at[:, k].add(sign * h * scale[k])))
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1]) / (2 * h)
        score = -2 * float(jnp.sum(blocks.p[:, k]))
        assert slope == pytest.approx(score, rel=1e-6, abs=1e-6 * abs(score) + 1e-2)
    states = point.states
    h = 1e-8
    for place in ((0, 1, 0), (0, 2, 1), (1, 3, 0)):
        ends = [
            cost(point._replace(states=states.at[place].add(sign * h)))
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1]) / (2 * h)
        score = -2 * float(blocks.s[place])
        assert slope == pytest.approx(score, rel=1e-5, abs=10.0)


def test_bounds_hold(problem):
    tight = dataclasses.replace(
        problem,
        parameters=tuple(
            dataclasses.replace(p, upper=0.55) if p.name == "restitution" else p
            for p in problem.parameters
        ),
    )
    bounded = fitting.fit(tight)
    # the true value is beyond the bound
    assert bounded["restitution"].value == 0.55


def test_random_starts_end_at_the_same_optimum(problem, found):
    rng = np.random.default_rng(3)
    same = 0
    for _ in range(50):
        start = {
            p.name: float(problem.start.values[0, k]) + p.tolerance * rng.uniform(-1, 1)
            for k, p in enumerate(problem.parameters)
        }
        again = fitting.fit(problem, start=start)
        same += abs(again.cost - found.cost) < 0.01
    assert same >= 45


@pytest.mark.slow
def test_held_out_records_and_candidates(problem, found):
    """A parameter that is not free is estimated by linear algebra as by a fit."""
    without = [n for n in problem.names if n != "restitution"]
    start = {"restitution": TRUTH["restitution"] + 2e-4}
    null = fitting.fit(problem, free=without, start={**TRUTH, **start})
    linear = fitting.linearise(problem, null)
    gain = linear.gain(["restitution"], beside=without)
    assert gain == pytest.approx(null.cost - found.cost, rel=0.05)
    step, stderr = linear.step(problem.names)["restitution"]
    assert null_value(null, problem) + step == pytest.approx(
        found["restitution"].value, abs=3 * stderr
    )
    only = problem.only(["run1"])
    half = fitting.fit(problem, start=found, weights=only)
    other = fitting.held_out_cost(problem, half, problem.only(["run2"]))
    seen = fitting.fit(problem, start=found, weights=problem.only(["run2"]))
    assert other > seen.cost - 20


def null_value(null, problem):
    return float(null.point.values[0, problem.names.index("restitution")])


def test_profile_agrees_with_fisher(problem, found):
    curve = fitting.profile(found, "restitution", points=5)
    low, high = curve.interval
    one = found["restitution"]
    assert low == pytest.approx(one.value - 1.96 * one.stderr, abs=0.3 * one.stderr)
    assert high == pytest.approx(one.value + 1.96 * one.stderr, abs=0.3 * one.stderr)


def test_bootstrap_scatters_around_the_optimum(found):
    again = fitting.bootstrap(found, 30, seed=1)
    names = [one.name for one in found.estimates]
    column = again.estimates[:, names.index("restitution")]
    one = found["restitution"]
    # the middle half of a Gaussian is 1.35 standard errors wide; a few repetitions
    # that lose most of the impacts are far off
    middle = np.subtract(*np.quantile(column, [0.75, 0.25])) / 1.35
    assert 0.3 < middle / one.stderr < 3.0
    low, high = again.interval("restitution")
    assert low < one.value < high


def test_what_cannot_be_seen_is_said(problem):
    report = fitting.identify(problem)
    words = " ".join(report.sentences())
    assert report.seen < len(report.names)
    assert "restitution" in words and "tolerances" in words


@pytest.mark.slow
def test_missing_samples_a_gap_and_a_slip():
    """Dropped samples, a gap at an impact and a slip: said, and still inside."""
    rng = np.random.default_rng(5)
    runs, notes = [], []
    for run in recorded():
        cut = segment_case([run], NOMINAL)[0]
        # the one nearest to the middle, so that both pieces see the cam turn
        hit = np.argmin(np.abs(cut.impacts.time - run.time[-1] / 2))
        impact = cut.impacts.time[hit]
        keep = rng.uniform(size=len(run)) > 0.05
        keep &= np.abs(run.time - impact) > 0.025
        cam = np.array(run["cam_angle_rad"])
        cam[len(cam) // 3 :] += 2 * np.pi
        channels = {
            "cam_angle_rad": cam,
            "follower_angle_rad": run["follower_angle_rad"],
        }
        faulty = dataclasses.replace(
            run,
            time=run.time[keep],
            channels={c: v[keep] for c, v in channels.items()},
        )
        mended = mend(faulty)
        runs += mended.recordings
        notes += mended.notes
    words = " ".join(notes)
    assert "are missing" in words and "a turn" in words and "split" in words
    assert len(runs) == 4
    again = fitting.fit(cam_problem(runs))
    assert again.converged
    assert_inside(again)


@pytest.mark.parametrize("record", [0, 1])
def test_first_bounce_of_each_turn(problem, found, record):
    """The thesis' procedure finds r within what its two numbers a turn can tell."""
    part = problem.segments[record]
    drive = fitting.engine.cam_follower_drive()
    measured = fitting.first_bounce(found.model().system, part, drive)
    impacts, flights = part.impacts, part.flights
    first = [
        k
        for k in range(impacts.count)
        if flights[impacts.flight[k]].start.kind == "release"
    ]
    assert len(measured) == len(first) >= 1
    height = np.array([flights[impacts.flight[k] + 1].height for k in first])
    # the speed goes with the root of the height, of which the largest of a few dozen
    # noisy samples is taken: two to three standard deviations too much
    bias = 3 * part.noise / (2 * height)
    rates = np.hypot(impacts.before_stderr[first], impacts.surface_stderr[first])
    error = np.hypot(part.noise / (2 * height), rates / impacts.approach[first])
    off = measured / TRUTH["restitution"] - 1
    assert np.all(off < bias + 3.3 * error)
    assert np.all(off > -3.3 * error)
    assert np.all(error < 0.03)


def test_first_bounce_needs_the_drive(found):
    run = recorded()[0]
    part = segment(run, "follower_angle_rad", noise=NOMINAL.sensors.follower_floor)
    with pytest.raises(RecordingError, match="segment_case"):
        fitting.first_bounce(
            found.model().system, part, fitting.engine.cam_follower_drive()
        )


def test_approach_speeds_of_a_driven_rig_are_taken_at_the_impact(problem, found):
    """Half a step of the cam later, they would differ by a quarter: local fits of the
    fastest quarter of the impacts agree with them to 3 % rms."""
    speeds = fitting.engine.approach_speeds(problem, found.point)
    for part, fitted in zip(problem.segments, speeds, strict=True):
        local = part.impacts.approach
        fast = local > np.quantile(local, 0.75)
        ratio = fitted[fast] / local[fast]
        assert np.sqrt(np.mean((ratio - 1) ** 2)) < 0.03


def test_profile_at_chosen_values(problem, found):
    """Its cost is that of a fit with the parameter held there, less the optimum's."""
    one = found["spring_hook_x"]
    curve = fitting.profile(found, one.name, values=[one.value, TRUTH[one.name]])
    np.testing.assert_array_equal(curve.values, np.sort([one.value, TRUTH[one.name]]))
    at_optimum = curve.cost[list(curve.values).index(one.value)]
    assert at_optimum == pytest.approx(0.0, abs=0.01)
    assert 0 <= max(curve.cost) < scipy.stats.chi2.ppf(0.999, 1)
