"""Diagnoses of a rig with switching surfaces: a cart that sticks, with a soft stop."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from test_fitting_switched import Cart, SENSORS

from jaxcam.discrepancy import diagnose
from jaxcam.discrepancy.terms import (
    library,
    Relaxation,
    system_with_element,
    system_with_terms,
)
from jaxcam.fitting import Model, Parameter, segment_by_model
from jaxcam.hybrid import simulate
from jaxcam.recordings import record


class Dragged(Cart):
    """The same with drag that grows with the square of the speed."""

    drag: float = 0.4

    def branch(self, t, state, sides):
        drag = self.drag * state[1] * jnp.abs(state[1])
        return super().branch(t, state, sides).at[1].add(-drag)


def diagnosis_of(truth):
    rng = np.random.default_rng(3)
    runs = [
        record(truth, SENSORS, 5.0, rng=rng, state=jnp.array([0.0, v]), name=f"v{v}")
        for v in (0.3, -0.2, 0.4)
    ]
    start = Cart(stiffness=60.5, friction=0.58, stop=0.0301, stop_stiffness=1950.0)
    names = {"stiffness": 2.0, "friction": 0.1, "stop": 1e-3, "stop_stiffness": 200.0}
    free = [
        Parameter(name, lambda m, n=name: getattr(m.system, n), tolerance=tolerance)
        for name, tolerance in names.items()
    ]
    parts = segment_by_model(Model(start, SENSORS), runs)
    return diagnose(start, tuple(parts), sensors=SENSORS, parameters=free)


def test_branches_together_are_the_branches_one_by_one():
    """With terms that do and do not depend on the force of the branch, and with an
    element; equal to rounding."""
    named = {term.name: term for term in library()}
    drag = dataclasses.replace(named["quadratic_drag"], c2=jnp.asarray(0.3))
    friction = dataclasses.replace(named["coulomb_friction"], fc=jnp.asarray(0.2))
    system = system_with_terms(Cart(), (drag, friction))
    wide = system_with_element(system, Relaxation(), (0, 1))
    rows = jnp.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
    cases = ((system, jnp.array([0.031, 0.2])), (wide, jnp.array([0.031, -0.2, 0.5])))
    for one, state in cases:
        together = one.branches(0.1, state, rows)
        alone = jnp.stack([one.branch(0.1, state, sides) for sides in rows])
        np.testing.assert_allclose(together, alone, rtol=1e-14, atol=0)
        assert np.ptp(np.asarray(together)[:, 1]) > 0.1


@pytest.mark.slow
def test_nothing_is_missing_from_a_rig_that_sticks():
    found = diagnosis_of(Cart())
    assert found.verdict == "none"


@pytest.mark.slow
def test_drag_is_found_beside_dry_friction():
    """Its strength to 1 %."""
    found = diagnosis_of(Dragged())
    assert found.names == ("quadratic_drag",)
    (strength,) = found.effects[0].parameters.values()
    assert abs(strength.value - 0.4) < 4e-3


class Walled(Cart):
    """The same with a rigid wall."""

    def gap(self, t, state):
        return state[0] + 0.02

    def impact(self, t, state):
        return state.at[1].multiply(-0.7)


def test_terms_and_elements_keep_the_events_of_a_system():
    """Without strength, switches and impacts of the system itself, to 1e-10 s."""
    start = jnp.array([0.0107, -0.2])
    run = simulate(Walled(), start, 0.0, 1.1)
    assert run.switches.time.size > 2 and run.impacts.time.size
    terms = system_with_terms(Walled(), ())
    element = system_with_element(terms, Relaxation(), (0, 1))
    for system, state in ((terms, start), (element, jnp.append(start, 0.0))):
        again = simulate(system, state, 0.0, 1.1)
        assert again.switches.kind.tolist() == run.switches.kind.tolist()
        assert np.max(np.abs(again.switches.time - run.switches.time)) < 1e-10
        assert np.max(np.abs(again.impacts.time - run.impacts.time)) < 1e-10
