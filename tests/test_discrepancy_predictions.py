"""Speeds at which a rig's motion changes, with and without a term."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.discrepancy import event_causes, library
from jaxcam.discrepancy._event_speeds import event_speeds
from jaxcam.discrepancy._predictions import _draws
from jaxcam.discrepancy.terms import WithTerms
from jaxcam.models import preset, rad_s_to_rpm


@pytest.fixture(scope="module")
def damped():
    damping = next(term for term in library() if term.name == "viscous_damping")
    rig = jax.tree.map(jnp.asarray, preset("calibrated"))
    return {
        c1: event_speeds(WithTerms(rig, (type(damping)(jnp.asarray(c1)),)))
        for c1 in (0.0, 0.02)
    }


@pytest.mark.slow
def test_without_a_term_they_are_those_of_the_rig(damped):
    """Detachment, fold, flip and interruption (rpm) as by path following, to 1e-5."""
    found = rad_s_to_rpm(damped[0.0].values)
    known = [125.15346241, 135.94691254, 151.86236348, 152.67696059]
    np.testing.assert_allclose(found, known, atol=1e-5)


@pytest.mark.slow
def test_damping_delays_all_of_them(damped):
    """What takes energy out is made up for by a faster cam."""
    assert np.all(damped[0.02].values > damped[0.0].values)


@pytest.mark.slow
def test_a_system_nearby_is_the_same_as_found_anew(damped):
    """From where the other ones are, to 1e-8 of the speeds."""
    rig = jax.tree.map(jnp.asarray, preset("calibrated"))
    damping = next(term for term in library() if term.name == "viscous_damping")
    system = WithTerms(rig, (type(damping)(jnp.asarray(0.02)),))
    near = damped[0.0].near(system)
    np.testing.assert_allclose(near.values, damped[0.02].values, rtol=1e-8)


@pytest.mark.slow
def test_the_cause_of_moved_events_is_found(damped):
    """Damping of 0.02 1/s from the four speeds that it makes, to a part in 1e4."""
    rig = preset("calibrated")
    damping = next(term for term in library() if term.name == "viscous_damping")
    speeds = damped[0.02].values
    first, second = event_causes(
        rig,
        speeds,
        np.full(4, 1e-4 * speeds[0]),
        [damping],
        lambda s: s.restitution.intercept,
        0.01,
    )
    assert (first.name, second.name) == ("viscous_damping", "none")
    assert first.strength == pytest.approx(0.02, rel=1e-4)
    np.testing.assert_allclose(first.speeds, speeds, rtol=1e-8)
    assert first.misfit < 1e-6 < 1 < second.misfit


def test_rigs_are_drawn_with_the_values_of_the_first_recording(unchecked_types):
    """Standard errors 0.1 and 0.2 (10 %, 2000 draws), correlation -0.5, and a parameter
    that the data do not constrain."""
    spread = np.array([0.1, 0.2, 0.3, np.inf])
    correlated = np.eye(4)
    correlated[0, 1] = correlated[1, 0] = -0.5
    with np.errstate(invalid="ignore"):
        covariance = np.where(
            correlated == 0, 0.0, correlated * np.outer(spread, spread)
        )
    labels = (("k", None), ("r", "run0"), ("r", "run1"), ("c", None))
    fit = SimpleNamespace(
        point=SimpleNamespace(values=np.array([[7.0, 1.0, 5.0], [7.0, 1.0, 6.0]])),
        covariance=covariance,
        estimates=[SimpleNamespace(name=n, record=r) for n, r in labels],
        problem=SimpleNamespace(records=("run0", "run1"), names=("k", "c", "r")),
    )
    rows = np.array(list(_draws(fit, 2000, np.random.default_rng(1))))
    np.testing.assert_allclose(rows.mean(axis=0), [7.0, 1.0, 5.0], atol=0.02)
    np.testing.assert_allclose(rows.std(axis=0), [0.1, 0.0, 0.2], rtol=0.1)
    assert np.corrcoef(rows[:, 0], rows[:, 2])[0, 1] == pytest.approx(-0.5, abs=0.06)


def test_what_four_speeds_cannot_decide_is_refused():
    rig, terms = preset("calibrated"), library()

    def where(rig):
        return rig.restitution.intercept

    with pytest.raises(ValueError, match="four speeds and four errors"):
        event_causes(rig, [1.0, 2.0], [0.1, 0.1], terms, where, 0.1)
    several = [term for term in terms if len(term.strengths()) > 1]
    with pytest.raises(ValueError, match="only terms with one strength"):
        event_causes(rig, [1.0] * 4, [0.1] * 4, several, where, 0.1)
