"""Calls that take long tell how far they are, and give the same result."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from continuation_examples import a, CUSP, cusp_start, LOGISTIC
from sweep_maps import SQUARE_ROOT

import continuation
from jaxcam import fitting, sweeps, timestepping
from jaxcam.cli import _reproduce
from jaxcam.cli._reproduce_record import make, Origin
from jaxcam.data import DEMO_RIG
from jaxcam.models import BouncingBall, CamFollower
from jaxcam.recordings import read_case, read_rig, Recording, segment_case
from jaxcam.thesis import reproduce, TARGETS
from jaxcam.thesis.progress import counted, of_share, of_sweep, report, reporting
from jaxcam.thesis.target import Target


def _shares(run):
    """The fractions that a call reports, which rise to one; its two results."""
    shares = []
    result, told = run(None), run(shares.append)
    assert shares == sorted(set(shares)) and shares[0] >= 0 and shares[-1] == 1.0
    return shares, result, told


def test_time_stepping():
    ball = BouncingBall()
    shares, one, other = _shares(
        lambda told: timestepping.moreau(
            ball, [1.0, 0.0], 0.0, 1.0, 2500, progress=told
        )
    )
    assert len(shares) == 3
    assert np.array_equal(one.state, other.state)
    system = timestepping.RelaySystem([[-1.0]], [[1.0]], [[1.0]])
    shares, *_ = _shares(
        lambda told: timestepping.relay_steps(system, [1.0], 1.0, 2500, progress=told)
    )
    assert len(shares) == 3


def test_cells_in_several_blocks():
    grid = sweeps.Grid((-2, -2), (2, 2), (92, 91))
    shares, one, other = _shares(
        lambda told: sweeps.cell_mapping(SQUARE_ROOT, grid, progress=told)
    )
    assert len(shares) == 3
    assert all(map(np.array_equal, one, other))
    # the blocks are in the order of the cells: the halves lead to the two roots
    left, right = one.group[[20, 70], 45]
    assert left != right
    assert (
        np.mean(one.group[10] == left) > 0.9 and np.mean(one.group[80] == right) > 0.9
    )


def test_a_branch_in_both_directions():
    shares, one, other = _shares(
        lambda told: continuation.branch(
            CUSP, cusp_start(-1.0), a, (-3.0, 3.0), direction="both", progress=told
        )
    )
    assert len(shares) > 10 and any(share > 0.5 for share in shares[:-1])
    assert np.array_equal(one.states, other.states)


def test_a_cascade():
    shares, *_ = _shares(
        lambda told: continuation.cascade(
            LOGISTIC, [0.5], "mu", (1.5, 4.0), flips=2, progress=told
        )
    )
    assert shares == [0.5, 1.0]


def test_a_batch_of_branches():
    starts, signs = [cusp_start(-1.0), cusp_start(-1.0)], np.array([-1, 1])

    def run(told):
        return continuation.follow_batch(
            CUSP, starts, a, (-3.0, 3.0), direction=signs, points=60, progress=told
        )

    shares, one, other = _shares(run)
    assert len(shares) > 1
    assert one.reasons == other.reasons and np.array_equal(one.count, other.count)
    assert np.array_equal(one.states, other.states)


def test_recordings_cut_one_by_one():
    time, rng = np.linspace(0.0, 1.0, 1001), np.random.default_rng(0)
    model = fitting.Model(BouncingBall(), {"height_m": fitting.Sensor(0, noise=1e-3)})
    runs = [
        Recording(str(k), time, {"height_m": 5 + rng.normal(0, 1e-3, 1001)})
        for k in range(2)
    ]
    shares, one, other = _shares(
        lambda told: fitting.segment_by_model(model, runs, progress=told)
    )
    assert shares == [0.0, 0.5, 1.0]
    assert len(one) == len(other) == 2
    setup = fitting.Setup(model)
    assert _shares(lambda told: setup.segments(runs, progress=told))[0] == shares


def test_a_case_of_a_cam_follower():
    rig, case = read_rig(DEMO_RIG / "rig.toml"), read_case(DEMO_RIG)
    run = tuple(case)[:1]
    shares, one, other = _shares(lambda told: segment_case(run, rig, progress=told))
    assert len(shares) == 3
    assert np.array_equal(one[0].impacts.time, other[0].impacts.time)


def test_a_fit_to_published_numbers_tells_its_cost():
    class One(eqx.Module):
        p: jax.Array

    told = []
    fit = fitting.fit_published(
        One(jnp.asarray(1.0)),
        lambda m: [m.p],
        [fitting.Published("square", lambda m: m.p**2, 4.0, 0.5)],
        names=["p"],
        tolerances=[10.0],
        progress=lambda number, cost: told.append((number, cost)),
    )
    numbers, costs = zip(*told)
    assert numbers == tuple(range(1, len(told) + 1))
    # at the start ((1 - 4) / 0.5)^2, without a pull
    assert costs[0] == pytest.approx(36.0)
    assert min(costs) == pytest.approx(
        fit.chi_square + ((fit.estimates[0] - 1) / 10) ** 2
    )


@pytest.fixture
def told_target(monkeypatch):
    """A target that reports in each of the ways that targets do."""

    def compute(system):
        report("preparing")
        of_share("measuring")(0.5)
        of_sweep("sweeping")(sweeps.blocks.Progress(3, 4, 1.0, 1.0))
        return [("one", 1.0, 1.0, "")]

    monkeypatch.setitem(TARGETS, "figure-9.9", Target("Nine", compute))
    return "figure-9.9"


SAID = [("preparing", None), ("measuring", 0.5), ("sweeping", 0.75)]


def test_a_target_reports_what_is_inside_it(told_target):
    told = []
    reproduce(told_target, CamFollower(), progress=lambda *said: told.append(said))
    assert told == SAID
    # not beyond the call
    reproduce(told_target, CamFollower())
    assert told == SAID


def test_the_command_shows_it(told_target):
    shown = []
    told = _reproduce._within(lambda *said: shown.append(said), "f (2 of 4)", 1, 4)
    origin = Origin("0", "calibrated", "default", "")
    record = make(told_target, CamFollower(), origin, None, False, told)
    assert record.error is None
    assert shown == [
        ("f (2 of 4): preparing", 0.25),
        ("f (2 of 4): measuring", 1.5 / 4),
        ("f (2 of 4): sweeping", 1.75 / 4),
    ]
    # of a single target of which nothing is known yet, no fraction
    shown.clear()
    _reproduce._within(lambda *said: shown.append(said), "f", 0, 1)("preparing", None)
    assert shown == [("f: preparing", None)]


def test_a_loop_over_items_counts_them():
    told = []
    with reporting(lambda *one: told.append(one)):
        assert list(counted("measuring lobe", np.array([3.0, 5.0]))) == [3.0, 5.0]
    assert told == [("measuring lobe, 1 of 2", 0.0), ("measuring lobe, 2 of 2", 0.5)]
