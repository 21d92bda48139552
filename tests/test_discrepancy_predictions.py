"""Speeds at which a rig's motion changes, with and without a term."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.discrepancy import event_speeds, library, WithTerms
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
