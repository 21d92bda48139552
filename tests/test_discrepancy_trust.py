"""Verdicts in the face of faults: noise, records, tolerances and candidates."""

from types import SimpleNamespace
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
from swing_rig import PARAMETERS, Swing

from jaxcam.discrepancy import diagnose, Policy, strength, Term, Verdict
from jaxcam.discrepancy.evidence import shares, VisitedStates
from jaxcam.discrepancy.evidence._held_out import HeldOut
from jaxcam.discrepancy.report import _write, Reason
from jaxcam.discrepancy.report._units_in_doubt import units_in_doubt
from jaxcam.discrepancy.search import system_question
from jaxcam.fitting import Parameter, Sensor
from jaxcam.recordings import Recording, segment
from jaxcam.recordings.cut import least_noise, measured_noise


_NOISE = 1e-4
_STIFFNESS = 150.0
_TIME = 1e-3 * np.arange(2500)


class SharpFriction(Term):
    """Dry friction with a corner that no step of a flight resolves."""

    name: ClassVar[str] = "sharp_friction"
    sentence: ClassVar[str] = "sharp dry friction"
    sharp: float = strength("[q]/s^2", 0.1, lower=0.0)

    def acceleration(self, motion):
        return -self.sharp * jnp.sign(motion.velocity)


class Sail(Term):
    """Drag of a sail, with the square of the velocity."""

    name: ClassVar[str] = "sail"
    sentence: ClassVar[str] = "drag of a sail"
    drag: float = strength("1/[q]", 0.1, lower=0.0)

    def acceleration(self, motion):
        return -self.drag * jnp.abs(motion.velocity) * motion.velocity


def _free(x0, c):
    """A damped oscillation that starts at rest, in closed form."""
    w = np.sqrt(_STIFFNESS - c * c / 4)
    decay = np.exp(-c * _TIME / 2)
    return x0 * decay * (np.cos(w * _TIME) + c / (2 * w) * np.sin(w * _TIME))


def _sailing(x0, drag):
    from scipy.integrate import solve_ivp

    def field(t, y):
        return [y[1], -_STIFFNESS * y[0] - 0.1 * y[1] - drag * abs(y[1]) * y[1]]

    found = solve_ivp(
        field, (0, _TIME[-1]), [x0, 0.0], "DOP853", _TIME, rtol=1e-10, atol=1e-12
    )
    return found.y[0]


def _diagnosed(motions, *, noise=_NOISE, stated=_NOISE, seed=1, **options):
    rng = np.random.default_rng(seed)
    runs = [
        Recording(
            f"run{k}", _TIME, {"angle_rad": x + noise * rng.standard_normal(len(x))}
        )
        for k, x in enumerate(motions)
    ]
    return diagnose(
        Swing(),
        [segment(run, "angle_rad", noise=stated) for run in runs],
        sensors={"angle_rad": Sensor(0, noise=stated)},
        parameters=list(PARAMETERS),
        **options,
    )


def test_noise_is_told_from_a_motion_with_few_samples_per_period():
    """White noise within 10 %, at 20 samples per period of a motion 300 times it."""
    rng = np.random.default_rng(3)
    motion = 0.3 * np.cos(2 * np.pi * np.arange(4000) / 20)
    noisy = motion + 1e-3 * rng.standard_normal(4000)
    assert measured_noise(noisy) > 1.5e-3
    assert least_noise(noisy) == pytest.approx(1e-3, rel=0.1)


def test_places_are_shown_where_data_are():
    """Positions on two islands: what is between them has no data."""
    islands = np.concatenate([np.linspace(0, 1, 500), np.linspace(3, 4, 500)])
    seen = VisitedStates(islands, islands, np.zeros(0), 4.0, {})
    grid = np.linspace(0, 4, 41)
    near = seen.near("position", grid, Policy())
    assert near[(grid < 1) | (grid > 3)].all()
    assert not near[(grid > 1.2) & (grid < 2.8)].any()
    assert seen.near("phase", grid, Policy()).all()


def test_shares_add_up(unchecked_types):
    """Two parts in proportion to what is lost without them; the rest is left."""
    problem = SimpleNamespace(samples=1000)
    before = SimpleNamespace(cost=9000.0, problem=problem)
    after = SimpleNamespace(cost=1000.0, problem=problem)
    found = shares(before, after, {"a": 3000.0, "b": 1000.0}, 2000.0)
    assert found.of == pytest.approx({"a": 0.6, "b": 0.2})
    assert found.left == pytest.approx(0.2)
    nothing = shares(after, after, {}, 0.0)
    assert (nothing.of, nothing.left) == ({}, 0.0)


@pytest.mark.slow
def test_a_noise_that_is_stated_too_small_is_measured():
    found = _diagnosed([_free(0.3, 0.1), _free(0.2, 0.1)], stated=_NOISE / 3)
    assert found.verdict is Verdict.NONE
    assert found.noise_floor == pytest.approx(_NOISE, rel=0.1)
    assert Reason.NOISIER in {caveat.reason for caveat in found.caveats}


@pytest.mark.slow
def test_a_parameter_beyond_its_tolerance_is_named_by_what_acts_like_it():
    """Damping of 0.17 1/s where the rig file allows 0.05 to 0.15.

    The BIC alone would rather believe in an odd rig: (0.07 / 0.029)^2 < log(5000). The
    tolerance tells the part of the rig to 0.05 / sqrt(3).
    """
    found = _diagnosed([_free(0.3, 0.17), _free(0.2, 0.17)])
    assert (found.verdict, found.names) == (Verdict.EFFECT, ("viscous_damping",))
    one = found.effects[0].parameters["c1"]
    assert one.value == pytest.approx(0.07, abs=0.002)
    assert one.stderr == pytest.approx(0.05 / np.sqrt(3), rel=0.1)
    assert found.heldout_after < 1.1 * _NOISE < found.heldout_before
    assert Reason.BEYOND_TOLERANCE in {caveat.reason for caveat in found.caveats}


@pytest.mark.slow
def test_a_parameter_beyond_its_tolerance_that_nothing_acts_like_is_said():
    """A stiffness of 150 where the rig file allows 145 +- 3: no term is a spring."""
    soft = Parameter(
        "stiffness", lambda m: m.system.stiffness, 3.0, nominal=145.0, unit="1/s^2"
    )
    found = _diagnosed([_free(0.3, 0.1), _free(0.2, 0.1)], candidates=(Sail(),))
    assert not found.caveats
    rng = np.random.default_rng(2)
    runs = [
        Recording(f"r{k}", _TIME, {"angle_rad": x + _NOISE * rng.standard_normal(2500)})
        for k, x in enumerate([_free(0.3, 0.1), _free(0.2, 0.1)])
    ]
    found = diagnose(
        Swing(),
        [segment(run, "angle_rad", noise=_NOISE) for run in runs],
        sensors={"angle_rad": Sensor(0, noise=_NOISE)},
        parameters=[soft, PARAMETERS[1]],
        candidates=(Sail(),),
    )
    assert found.verdict is Verdict.NONE
    (caveat,) = [c for c in found.caveats if c.reason is Reason.BEYOND_TOLERANCE]
    assert "stiffness is 150" in caveat.sentence


@pytest.mark.slow
def test_one_misread_record_does_not_hide_the_answer():
    """Drag in five records, and a sixth that is another oscillator altogether."""
    motions = [_sailing(x, 0.3) for x in (0.3, 0.25, 0.2, 0.35, 0.28)]
    other = 0.2 * np.cos(9.0 * _TIME) * (1 + 0.3 * np.sin(2 * _TIME))
    found = _diagnosed([*motions[:3], other, *motions[3:]], candidates=(Sail(),))
    assert (found.verdict, found.names) == (Verdict.EFFECT, ("sail",))
    one = found.effects[0].parameters["drag"]
    assert one.value == pytest.approx(0.3, abs=4 * one.stderr)
    aside = [c for c in found.caveats if c.reason is Reason.SET_ASIDE]
    assert len(aside) == 1 and "run3" in aside[0].sentence
    assert "run3" not in found.records


@pytest.mark.slow
def test_a_misread_record_outside_the_range_of_the_others():
    """With an offset of 0.2. It is excluded if drag acts in the others; if nothing is
    missing in them, the verdict is unknown, and the record is questioned.
    """
    starts = (0.3, 0.25, 0.2, 0.35, 0.28)
    motions = [_sailing(x, 0.3) for x in starts]
    found = _diagnosed([*motions, motions[3] + 0.2], candidates=(Sail(),))
    assert found.names == ("sail",) and "run5" not in found.records
    one = found.effects[0].parameters["drag"]
    assert one.value == pytest.approx(0.3, abs=4 * one.stderr)
    (aside,) = [c for c in found.caveats if c.reason is Reason.SET_ASIDE]
    assert "run5 is excluded" in aside.sentence
    motions = [_free(x, 0.1) for x in starts]
    found = _diagnosed([*motions, motions[3] + 0.2], candidates=(Sail(),))
    assert found.verdict is Verdict.UNKNOWN
    (aside,) = [c for c in found.caveats if c.reason is Reason.SET_ASIDE]
    assert "Without the recording run5, nothing is missing." in aside.sentence


@pytest.mark.slow
def test_a_candidate_that_cannot_be_fitted_hides_no_other():
    motions = [_sailing(0.3, 0.3), _sailing(0.2, 0.3)]
    alone = _diagnosed(motions, candidates=(Sail(),))
    both = _diagnosed(motions, candidates=(Sail(), SharpFriction()))
    assert alone.names == both.names == ("sail",)
    (value,) = (one.effects[0].parameters["drag"].value for one in (both,))
    assert value == pytest.approx(alone.effects[0].parameters["drag"].value, rel=1e-3)


def test_an_unknown_word_for_the_candidates_is_refused(unchecked_types):
    with pytest.raises(ValueError, match='is "all"; give terms, or "extended"'):
        _diagnosed([_free(0.3, 0.1), _free(0.2, 0.1)], candidates="all")


def test_the_extended_library_is_chosen_by_a_word():
    """Its terms are offered in addition to those of the library."""
    runs = [
        Recording(f"run{k}", _TIME, {"angle_rad": _free(x0, 0.1)})
        for k, x0 in enumerate((0.3, 0.2))
    ]
    parts = [segment(run, "angle_rad", noise=_NOISE) for run in runs]
    few, many = (
        {
            term.name
            for term in system_question(
                Swing(),
                parts,
                candidates,
                {"angle_rad": Sensor(0, noise=_NOISE)},
                PARAMETERS,
                None,
                lambda *_: None,
                Policy(),
            ).terms
        }
        for candidates in (None, "extended")
    )
    assert few < many and "stop_above" in many - few


@pytest.mark.slow
def test_a_search_whose_time_is_over_says_so():
    """Without any time, no candidate is tried; the misfit is still reported."""
    found = _diagnosed(
        [_sailing(0.3, 0.3), _sailing(0.2, 0.3)],
        candidates=[Sail()],
        policy=Policy(minutes=1e-9),
    )
    assert found.verdict is Verdict.UNKNOWN and found.names == ("unknown",)
    assert Reason.TIME in {caveat.reason for caveat in found.caveats}
    assert found.left_before


@pytest.mark.parametrize(
    ("after", "single", "said"),
    [
        (999.0, None, False),
        (1001.0, None, True),
        (2.0, 1001.0, True),
        (1e6, 2.0, False),
    ],
)
@pytest.mark.usefixtures("unchecked_types")
def test_a_hopeless_model_doubts_the_units(after, single, said):
    """Beyond 1000 times the noise, on held-out data or on single pieces."""
    errors = [] if single is None else [SimpleNamespace(residual=single, stated=1.0)]
    caveats = units_in_doubt(
        SimpleNamespace(model_errors=errors, doubted=""),  # pyright: ignore
        SimpleNamespace(held=SimpleNamespace(after=after)),  # pyright: ignore
        Policy(),
    )
    assert [caveat.reason for caveat in caveats] == [Reason.UNITS] * said


@pytest.mark.usefixtures("unchecked_types")
def test_positions_that_contradict_the_stops_are_a_caveat():
    question = SimpleNamespace(doubted="No impact was found.", model_errors=())
    choice = SimpleNamespace(held=SimpleNamespace(after=1.0))
    (caveat,) = units_in_doubt(question, choice, Policy())  # pyright: ignore
    assert caveat.reason is Reason.UNITS
    assert caveat.sentence == "No impact was found."


@pytest.mark.usefixtures("unchecked_types")
@pytest.mark.parametrize(
    ("left", "held", "reasons"),
    [
        (1.0, 2.7, [Reason.POOR_PREDICTION]),
        (1.5, 2.7, [Reason.POOR_FIT]),
        (1.0, 1.0, []),
    ],
)
def test_functions_that_explain_but_do_not_predict(left, held, reasons, monkeypatch):
    """The model is not called incomplete if all data leave only noise."""
    monkeypatch.setattr(_write, "rms_of", lambda fit: left)
    choice = SimpleNamespace(
        unnamed=SimpleNamespace(rivals=()),
        named=SimpleNamespace(direction=None),
        held=HeldOut(10.0, held, {}, ([], [])),
        differing=None,
        tied=None,
    )
    missing = SimpleNamespace(fit=None, functions=(), names=(), decoys=())
    found = list(_write._doubts_of(choice, missing, Policy()))  # pyright: ignore
    assert [caveat.reason for caveat in found] == reasons
