"""A parameter that differs from recording to recording; truth from closed forms."""

import types

import numpy as np
import pytest
from swing_rig import Swing

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.evidence._choice import _fewest, _Separate
from jaxcam.discrepancy.evidence._differing import differing
from jaxcam.discrepancy.report._caveats import may_differ, Reason
from jaxcam.discrepancy.search._roughness import Roughness
from jaxcam.discrepancy.search._slots import filled, Free, roomy
from jaxcam.discrepancy.terms import Family, Variable, Where, WithTerms
from jaxcam.fitting import fit, Model, Parameter, Problem, Sensor
from jaxcam.recordings import Recording, segment


NOISE = 1e-4
TIME = 1e-3 * np.arange(2500)
STIFFNESS, DAMPING = 150.0, 0.3


def _free(x0, damping):
    """A damped oscillation that starts at rest."""
    w = np.sqrt(STIFFNESS - damping**2 / 4)
    decay = np.exp(-damping * TIME / 2)
    return x0 * decay * (np.cos(w * TIME) + damping / (2 * w) * np.sin(w * TIME))


def _fitted(motions):
    rng = np.random.default_rng(4)
    parts = []
    for number, motion in enumerate(motions):
        noisy = motion + NOISE * rng.standard_normal(len(motion))
        run = Recording(f"run{number}", TIME, {"angle_rad": noisy})
        parts.append(segment(run, "angle_rad", noise=NOISE))
    model = Model(Swing(damping=0.2), {"angle_rad": Sensor(0, noise=NOISE)})
    parameters = [
        Parameter("stiffness", lambda m: m.system.stiffness, 3.0, unit="1/s^2"),
        Parameter("damping", lambda m: m.system.damping, 0.2, unit="1/s"),
    ]
    return fit(Problem.build(model, parts, parameters))


def test_the_parameter_that_differs_is_found():
    """The damping of each recording, within four standard errors; noise remains."""
    true = np.array([0.30, 0.32, 0.29, 0.35])
    found = differing(_fitted([_free(0.1, c) for c in true]), Policy())
    assert found is not None
    assert found.name == "damping" and found.unit == "1/s"
    assert np.all(np.abs(found.values - true) < 4 * found.stderr)
    assert np.all(found.stderr < 0.002)
    assert found.complete and found.share > 0.99
    assert abs(found.left - 1) < 0.03
    assert found.to_json()["values"]["run3"][0] == pytest.approx(found.values[3])


def test_equal_recordings_do_not_differ():
    assert differing(_fitted([_free(x, DAMPING) for x in (0.1, 0.2)]), Policy()) is None


def test_one_recording_does_not_differ():
    """Even with a residual: its first second lacks a tenth of the damping."""
    motion = np.where(TIME < 1, _free(0.1, 0.9 * DAMPING), _free(0.1, DAMPING))
    assert differing(_fitted([motion]), Policy()) is None


def test_a_model_without_parameters_has_none_that_differs():
    """The nominal stiffness is wrong, and nothing is free."""
    problem = _fitted([_free(x, DAMPING) for x in (0.1, 0.2)]).problem
    fixed = fit(problem, free=())
    assert fixed.cost > 2 * problem.samples
    assert differing(fixed, Policy()) is None


def test_a_force_common_to_the_recordings_is_no_difference():
    """A force that acts from one second on in every recording."""
    settled = 0.002 * (1 - np.cos(np.sqrt(STIFFNESS) * (TIME - 1))) * (TIME > 1)
    found = differing(
        _fitted([_free(x, DAMPING) + settled for x in (0.1, 0.1)]), Policy()
    )
    assert found is None


def test_a_form_that_jumps_has_more_substeps():
    """At least 8 in every recording, while its curve and a smooth form keep theirs."""
    noisy = _free(0.2, 0.3) + NOISE * np.random.default_rng(4).normal(size=len(TIME))
    run = Recording("run", TIME, {"angle_rad": noisy})
    model = Model(WithTerms(Swing(damping=0.2)), {"angle_rad": Sensor(0, noise=NOISE)})
    problem = Problem.build(model, [segment(run, "angle_rad", noise=NOISE)], [])
    family = Family(Where.FLIGHT, Variable.TIME, 0.0, 2.5)
    room = roomy(problem, family, (), None)
    before = np.asarray(room.pieces.substeps)
    assert np.all(before < 8)
    forms = {one.name: one for one in family.primitives}
    for name, least in ((None, 0), ("step", 8), ("window", 8), ("bump", 0)):
        form = forms[name] if name else None
        one = Free(family, Roughness(), "force_a", form)
        made = np.asarray(filled(room, [one]).pieces.substeps)
        np.testing.assert_array_equal(made, np.maximum(before, least))


def _separate(bic, complete=True):
    """Separate values of which only the evidence matters."""
    return types.SimpleNamespace(bic=bic, complete=complete)


def test_terms_that_hardly_improve_separate_values_are_dropped(unchecked_types):
    """The named terms have a BIC of 1000; a difference below 10 is a tie."""
    policy, alone = Policy(), _separate(905.0)
    assert _fewest(_Separate(_separate(900.0), alone, False), 1000.0, policy) is alone
    with_terms = _separate(890.0)
    assert _fewest(_Separate(with_terms, alone, False), 1000.0, policy) is with_terms


def test_separate_values_must_leave_noise_and_beat_the_terms(unchecked_types):
    policy = Policy()
    assert (
        _fewest(_Separate(_separate(900.0, False), None, False), 1000.0, policy) is None
    )
    assert _fewest(_Separate(_separate(1001.0), None, False), 1000.0, policy) is None
    assert _fewest(_Separate(None, None, False), 1000.0, policy) is None
    only = _separate(950.0)
    assert _fewest(_Separate(_separate(1001.0), only, False), 1000.0, policy) is only


def test_values_that_tie_with_a_function_are_stated_with_the_next_recording():
    found = _fitted([_free(0.3, 0.25), _free(0.2, 0.35)])
    one = differing(found, Policy())
    assert one is not None and one.name == "damping"
    caveat = may_differ(one, Policy())
    assert caveat.reason is Reason.TIE
    assert "run0 0.25" in caveat.sentence and "run1 0.35" in caveat.sentence
    assert "Make a recording" in caveat.sentence
