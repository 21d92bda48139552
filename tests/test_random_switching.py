"""Random systems with switching surfaces: a sample of `benchmarks/random_switching.py`.

The times of all events and the states there agree with exact motions (by matrix
exponentials) to 1e-9 times the growth of errors, or the test fails. The exact motions
are compared with closed forms.
"""

import equinox as eqx
import numpy as np
import pytest

import jaxcam
from benchmarks._switching_draw import draw, FAMILIES
from benchmarks._switching_exact import CROSSES, LEAVES, motion, Programs, SLIDES
from benchmarks._switching_invariants import broken
from benchmarks._switching_linear import Linear
from benchmarks._switching_verdict import judge, know, SETTINGS
from benchmarks.random_switching import main, verdict_of


# two of the ten programs take a minute to compile
SLOW = "friction and impacts", "friction beside impacts"


@pytest.mark.parametrize(
    "family",
    [pytest.param(f, marks=pytest.mark.slow if f in SLOW else ()) for f in FAMILIES],
)
def test_random_systems(family):
    first = FAMILIES.index(family)
    verdicts = [verdict_of(seed) for seed in (first, first + len(FAMILIES))]
    assert all(v.label == "agrees" for v in verdicts), verdicts
    assert max(v.error for v in verdicts) < 1e-10
    assert sum(v.events for v in verdicts) >= 3


ONCE_WRONG = {
    "a body that has stuck from the start, where another breaks loose": 254,
    "stick after a first short step": 2052,
    "static friction in a contact at the start": 2719,
    "static friction after an impact that stops the slip": 669,
    "a slip that the rest of a chatter stops": 129,
    "two relays on which the motion slides": 3538,
}


@pytest.mark.parametrize("seed", ONCE_WRONG.values(), ids=ONCE_WRONG)
def test_systems_that_were_wrong(seed):
    verdict = verdict_of(seed)
    assert verdict.label == "agrees" and verdict.compared > 0.9, verdict


@pytest.mark.slow
def test_more_random_systems():
    """Nearly all of 300, which take half a minute after compilation."""
    labels = [verdict_of(seed).label for seed in range(300)]
    assert labels.count("agrees") > 285


@pytest.mark.parametrize("field", ["friction", "belts", "static", "drive"])
def test_a_small_defect_is_seen(field):
    """A parameter that differs in the seventh digit."""
    problem = draw(14)
    known = know(problem)

    def changed(value):
        return value * (1 + 1e-6) + 1e-7

    system = eqx.tree_at(
        lambda s: getattr(s, field), problem.system, replace_fn=changed
    )
    wrong = judge(problem._replace(system=system), known)
    assert wrong.label == "DISAGREES"


def test_a_force_outside_the_cone_and_a_rise_of_energy_are_seen():
    problem = draw(23)
    run = jaxcam.simulate(
        problem.system, problem.state, 0.0, problem.span, settings=SETTINGS
    )
    assert np.any(np.asarray(run.steps.sides) == 0)
    assert broken(problem, run, problem.span) == ""
    loads = 0.5 * problem.linear.loads
    weaker = problem._replace(linear=problem.linear._replace(loads=loads))
    assert "held by" in broken(weaker, run, problem.span)
    rising = problem._replace(energy=lambda x: -float(x @ x))
    assert "energy rises" in broken(rising, run, problem.span)


def test_a_disagreement_is_printed_and_is_the_exit_code(monkeypatch, capsys):
    def half(seed, settings):
        problem = draw(seed)
        halved = problem._replace(state=problem.state / 2)
        return judge(halved, know(problem), settings)

    monkeypatch.setattr("sys.argv", ["random_switching", "--seed", "2"])
    assert main() == 0
    monkeypatch.setattr("benchmarks.random_switching.verdict_of", half)
    assert main() == 1
    assert "seed 2 (friction) DISAGREES" in capsys.readouterr().out


# --- the exact motions themselves


def _oscillator(row, kick: float, load, slides=True, static=1.0) -> Linear:
    """x'' = -x + side * kick * load, with one surface; the forcing has frequency 1."""
    field = np.zeros((2, 5))
    field[0, 1], field[1, 0] = 1.0, -1.0
    return Linear(
        omega=1.0,
        phase=0.0,
        field=field,
        rows=np.array([row]),
        kicks=np.array([[0.0, kick]]),
        loads=np.array([load]),
        width=np.zeros(1),
        holding=np.array([static]),
        slidable=(slides,),
        gaps=np.zeros((0, 5)),
        normals=np.zeros((0, 2)),
        restitution=np.zeros(0),
    )


def test_exact_stick_slip_cycle():
    """A block on a belt: sticks up to static friction, slips on an arc."""
    f, belt, static = 0.4, 0.3, 1.5
    block = _oscillator(
        [0.0, 1.0, -belt, 0.0, 0.0],
        -1.0,
        [0.0, 0.0, f, 0.0, 0.0],
        static=static,
    )
    found = motion(Programs(block), [0.0, belt], 16.0).events[1:]
    slip = 2 * np.pi - 2 * np.arctan2((static - 1) * f, belt)
    stick = 2 * (static - 1) * f / belt
    first = static * f / belt
    wanted = [first, first + slip, first + slip + stick, first + 2 * slip + stick]
    assert [e.kind for e in found[:4]] == [LEAVES, SLIDES, LEAVES, SLIDES]
    assert np.max(np.abs(np.array([e.time for e in found[:4]]) - wanted)) < 1e-13


@pytest.mark.parametrize("depth", [1e-4, 1e-9, 1e-13])
def test_exact_crossings_within_one_interval_of_the_grid(depth):
    """x = cos(t - 2) exceeds 1 - depth for a short time, with no force beyond."""
    touch = _oscillator(
        [1.0, 0.0, depth - 1.0, 0.0, 0.0], 0.0, np.zeros(5), slides=False
    )
    start = [np.cos(2.0), np.sin(2.0)]
    found = motion(Programs(touch), start, 5.0).events
    half = np.arccos(1 - depth)
    assert [e.kind for e in found] == [CROSSES, CROSSES]
    times = np.array([e.time for e in found])
    # the depth is known to 1e-16
    assert np.max(np.abs(times - [2 - half, 2 + half])) < 1e-15 / half + 1e-14


def test_exact_chatter_of_a_ball():
    """The impacts are summed one by one; they end at 3 flight times of the fall."""
    free = np.zeros((2, 5))
    free[0, 1], free[1, 2] = 1.0, -2.0
    ball = Linear(
        omega=1.0,
        phase=0.0,
        field=free,
        rows=np.zeros((0, 5)),
        kicks=np.zeros((0, 2)),
        loads=np.zeros((0, 5)),
        width=np.zeros(0),
        holding=np.zeros(0),
        slidable=(),
        gaps=np.eye(5)[:1],
        normals=np.eye(2)[1:],
        restitution=np.array([0.5]),
    )
    found = motion(Programs(ball), [1.0, 0.0], 4.0)
    # falls for 1 s, then flights of 1, 1/2, 1/4, ... s
    times = np.array([e.time for e in found.events])
    assert np.max(np.abs(times[:20] - (3 - 2.0 ** (1 - np.arange(20))))) < 1e-13
    assert abs(times[-1] - 3) < 1e-11 and np.max(np.abs(found.final)) < 1e-15
