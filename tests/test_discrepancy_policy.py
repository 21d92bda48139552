"""The policy of a diagnosis is documented and checked, and its groups do as said."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np
import pytest
from scipy.stats import norm

from jaxcam.data import DEMO_RIG
from jaxcam.discrepancy import library, Policy
from jaxcam.discrepancy.policy import Group
from jaxcam.discrepancy.search import Clock, given_up, Search
from jaxcam.discrepancy.terms import Motion, shapes
from jaxcam.recordings import read_rig, References, RigError


ROOT = Path(__file__).parents[1]
_PAGE = (ROOT / "docs" / "discrepancy.md").read_text("utf-8")


def _written(value) -> str:
    several = isinstance(value, tuple)
    return ", ".join(f"{one:g}" for one in value) if several else f"{value:g}"


def _table(headings, rows) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


@pytest.mark.parametrize("group", Group)
def test_the_page_states_every_number_of_the_policy(group):
    rows = [
        [f"`{one.name}`", _written(one.value), one.says]
        for one in Policy().settings()
        if one.group == group
    ]
    table = _table(["field", "default", "meaning"], rows)
    assert table in _PAGE, f"put this table into docs/discrepancy.md:\n\n{table}"


def test_the_page_states_every_free_function():
    rows = [
        [f"`{one.name}`", one.sentence, str(one.variable), str(one.count)]
        for one in shapes((0.0, 1.0), (-1.0, 1.0), (0.0, 1.0), (0.0, 1.0))
    ]
    table = _table(["shape", "meaning", "variable", "coefficients"], rows)
    assert table in _PAGE, f"put this table into docs/discrepancy.md:\n\n{table}"


def test_the_page_states_the_constants_of_forms():
    rows = []
    for field in dataclasses.fields(References):
        rows.append([f"`{field.name}`", _written(field.default)])
    table = _table(["constant", "default"], rows)
    assert table in _PAGE, f"put this table into docs/discrepancy.md:\n\n{table}"


def test_no_module_of_the_package_keeps_numbers_of_its_own():
    """Named numbers at the top of a module are guards against rounding, or say how a
    function is written down, and no more.

    What decides or bounds anything is a field of the policy, of a term or of a rig.
    """
    allowed = {
        "_A_STEP",
        "_PAIRS",
        "_SIDE",
        "_TOLERANCE",
        "_TINY",
        "TINY",
        "_END",
        "_STATES",
        "_SHAKEN",
        "_DEFINITE",
        "_ANGLES",
        # nodes of a force in a piece of flight
        "_NODES",
        "_SLOWEST",
        # step of finite differences
        "_CHANGE",
        "_SECOND",
        "_SMALLEST",
        "_LOOKS",
        "_KNOTS",
        "_MARGIN",
        "_SINES",
        # how a function is written into a table
        "_FINER",
        # substeps in which a force with edges is integrated
        "_SUBSTEPS",
        # how the corner of dry friction is written down
        "_HELD",
        "_FADE",
        "_MANY",
        "_RESOLVED",
        # the forms of free functions, and where a fit of them may start
        "_EDGE",
        "_EDGE_OF_PHASE",
        "_FLATTEST",
        "EVERY",
        "_AT_END",
        "_LEAST",
        "BEYOND",
        "_GRID",
        "_INSIDE",
        "_EVERY",
        "STRAIGHT",
        "SQUARE",
        "CUBE",
        "DRY",
        "FORWARD",
        "BACKWARD",
        # where a scan of edges, speeds and hidden elements looks, and in what chunks
        "_SHARES",
        "_BEGINS",
        "_TOGETHER",
        "_RATIOS",
        "_TIMES",
        "_LIMITS",
        "_SHAPES",
        "_STIFFENING_LIMITS",
        "_STIFFENING_SHAPES",
        "_MOST",
        "_AT_ONCE",
        "_FORCES",
        "_WINDOW",
        "_STRIDE",
        "_BESIDE",
        "_STEP",
        "_LARGEST_START",
        "_SETTLED",
        "_REACHING",
        "_SLOW",
        # rounds in which the centre of a stiffness is estimated
        "_ROUNDS",
        "_ALIKE",
        # below which a negative eigenvalue is a rounding error
        "_ROUNDING",
        # above which the derivatives of a piece diverge
        "_DIVERGED",
        # how complete flights are approached
        "_PARTS",
        # when joints that allow for model errors are consistent with the samples
        "_CONSISTENT",
        # how Newton steps for states of held-out data are shortened
        "_SHORTER",
        "_SHORTEST",
        # of the distribution of sections that are held out
        "_SEED",
        # how many memory mappings the compiled programs of a diagnosis take
        "_NEEDED",
        # how many signals a hidden element has
        "SHARED",
        "STARTS",
        "DIRECT",
        # how sums of forms are refined in the likelihood of a curve
        "MOST_PARTS",
        "_REFINED",
        "_EVALUATIONS",
        "_MORE",
        # how products of forms are found from a surface, and where their numbers are
        "_HARMONICS",
        "_FIRST",
        "_SECOND",
        "GATE_PLACES",
        # how the arguments of a knockoff are shifted
        "_BLOCKS",
        "_SHIFTS",
        # when a constant and a slope of a function are those of the rig
        "_UNDETERMINED",
        # how a phase is written, and the units of functions with a factor
        "_BELOW_ZERO",
        "_FACTOR_UNITS",
        # damping of a resonance without a peak, only in words
        "_NO_PEAK",
        # points of a table of a hidden element
        "_DECADE",
        "_STEPS",
    }
    found = set()
    for file in (ROOT / "jaxcam" / "discrepancy").rglob("*.py"):
        for line in file.read_text("utf-8").splitlines():
            names, _, value = line.partition(" = ")
            if line[:1].isspace() or not value or not names.replace(", ", "").isupper():
                continue
            if any(c.isdigit() for c in value) and not value.startswith('"'):
                found |= set(names.replace(" ", "").split(","))
    assert found == allowed


def test_what_can_be_derived_is():
    policy = Policy(confidence=0.95, form_error=0.2)
    assert policy.beyond == pytest.approx(norm.ppf(0.95), rel=1e-15)
    # a force that is off by a share leaves its square in the likelihood
    assert policy.small == pytest.approx(0.04, rel=1e-15)


def test_other_constants_need_no_other_program():
    """Compiled programs are kept by the structure of their arguments, so the next
    recordings of a rig, with other speeds, use those of the first.
    """
    other = References(*(2 * x for x in dataclasses.astuple(References())))
    for one, two in zip(library(), library(references=other), strict=True):
        assert jax.tree.structure(one) == jax.tree.structure(two), one.name


@pytest.mark.parametrize(
    "wrong",
    [
        {"false_alarms": 0.0},
        {"false_alarms": 1.0},
        {"confidence": -0.1},
        {"iterations": 0},
        {"tie": float("nan")},
        {"drive_orders": (1.25, -1.0)},
    ],
)
def test_a_policy_out_of_range_is_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Policy(**wrong)


def test_terms_far_from_the_data_leave_time_for_functions(monkeypatch, unchecked_types):
    """Of 20 minutes, terms may take 10 while their cost is 5 per sample, and 20 while
    it is 3; a search that is cut short says so."""
    now = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    monkeypatch.setattr("time.process_time", lambda: now[0])

    def late(cost: float, minutes: float) -> bool:
        now[0] = 0.0
        clock = Clock(20.0)
        problem = SimpleNamespace(samples=100)
        trials = SimpleNamespace(
            policy=Policy(), least_cost=100 * cost, problem=problem, clock=clock
        )
        now[0] = 60 * minutes
        found = Search(trials)._late()
        assert clock.stopped == found
        return found

    assert [late(5.0, at) for at in (9.9, 10.1, 20.1)] == [False, True, True]
    assert [late(3.0, at) for at in (9.9, 10.1, 20.1)] == [False, False, True]


def test_a_budget_bounds_the_search():
    """A fit that always gains, and never enough, is late after `late_attempts`."""
    costs = [900.0 * 0.9**k for k in range(16)]
    for late in (3, 8, 12):
        stop = given_up(100, Policy(late_attempts=late), beaten=100.0)
        first = next(k for k in range(1, 16) if stop(costs[:k]))
        assert first == late + 1


def test_the_constants_of_a_rig_reach_its_terms(tmp_path):
    """Those of the file, and where it says nothing those of the thesis' rig."""
    text = (DEMO_RIG / "rig.toml").read_text("utf-8")
    rig = tmp_path / "rig.toml"
    rig.write_text(text)
    assert read_rig(rig).references == References()
    rig.write_text(
        text + "\n[references]\nspring_center = 0.31\n"
        'impact_speed = {value = 0.5, unit = "rad/s"}\nslip_speed = 0.02\n'
    )
    found = read_rig(rig).references
    assert found == References(spring_center=0.31, impact_speed=0.5, slip_speed=0.02)
    terms = {term.name: term for term in library(references=found)}
    assert terms["nonlinear_spring"].center == 0.31
    assert terms["restitution_velocity"].reference == 0.5
    assert terms["cam_profile_error"].lead == References().profile_lead
    for name in ("coulomb_friction", "stribeck_friction", "asymmetric_friction"):
        assert terms[name].slip == 0.02
    # half of the restitution's fall by the definition of its form, r = (1 + v/v0)^-rb
    bounce = dataclasses.replace(terms["restitution_velocity"], rb=1.0)
    motion = Motion(0.0, 0.0, -0.5, 0.0)
    assert float(bounce.restitution(0.5, motion)) == pytest.approx(0.5, rel=1e-14)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("slip_speed = 0.0", "slip_speed.*positive"),
        ("spring_centre = 0.3", "is `spring_center` meant"),
        ('profile_lead = {value = 1.0, unit = "deg"}', 'given in "deg"'),
    ],
)
def test_a_wrong_constant_of_a_rig_is_named(tmp_path, line, said):
    text = (DEMO_RIG / "rig.toml").read_text("utf-8")
    rig = tmp_path / "rig.toml"
    rig.write_text(f"{text}\n[references]\n{line}\n")
    with pytest.raises(RigError, match=said):
        read_rig(rig)


def test_free_friction_changes_sign_at_the_speed_of_the_rig():
    """`tanh(v / slip)` at `v = slip`."""
    offered = shapes(
        (0.0, 1.0),
        (-1.0, 1.0),
        (0.0, 1.0),
        (0.0, 1.0),
        references=References(free_slip_speed=0.2),
    )
    friction = next(one for one in offered if one.name == "friction_of_position")
    friction = dataclasses.replace(friction, coefficients=(1.0, 0.0, 0.0))
    force = friction.acceleration(Motion(0.0, 0.5, 0.2, 0.0))
    assert float(force) == pytest.approx(-np.tanh(1.0), rel=1e-12)
