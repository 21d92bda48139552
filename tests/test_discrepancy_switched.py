"""Diagnoses of a rig with switching surfaces: a cart that sticks, with a soft stop."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from test_fitting_switched import Cart, SENSORS

from jaxcam.discrepancy import diagnose
from jaxcam.discrepancy.terms import (
    ConstantForce,
    library,
    Relaxation,
    system_with_element,
    system_with_terms,
)
from jaxcam.fitting import Model, Parameter, segment_by_model
from jaxcam.hybrid import HybridAutomaton, Settings, simulate
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


class Latched(HybridAutomaton):
    """A body that falls until a latch holds it for 0.5 s and lifts it again."""

    modes = ("falls", "rests")
    transitions = (("falls", "rests"), ("rests", "falls"))
    held = {"rests": (1,)}

    def fields(self, t, state, sides):
        falls = jnp.stack([state[1], 1.0, 0.0])
        return jnp.stack([falls, jnp.array([0.0, 0.0, 1.0])])

    def guards(self, t, state):
        return jnp.stack([0.5 - state[0], 0.5 - state[2]])

    def resets(self, t, state):
        return jnp.stack([state.at[1].set(0.0), state.at[0].set(0.0)])


def test_an_added_force_does_not_move_a_body_that_a_mode_holds():
    """The times of the events, in closed form to 1e-9: the body falls 0.5 m with 1.25
    m/s^2, and rests for 0.5 s."""
    system = system_with_terms(Latched(), (ConstantForce(f0=0.25),))
    for backend in ("llvm", "xla"):
        run = simulate(
            system, jnp.zeros(3), 0.0, 2.0, settings=Settings(backend=backend)
        )
        fall = np.sqrt(2 * 0.5 / 1.25)
        np.testing.assert_allclose(run.switches.time, [fall, fall + 0.5], atol=1e-9)
        assert float(run.final[1]) == pytest.approx(1.25 * (1.5 - fall), abs=1e-9)
    rests = system.sides(0.0, jnp.zeros(3)).at[0].set(-1.0)
    wide = system_with_element(system, Relaxation(), (0, 1))
    moving = jnp.array([0.1, 0.7, 0.0, 0.4])
    rows = jnp.stack([rests, -rests])
    together = wide.branches(0.0, moving, rows)
    alone = jnp.stack([wide.branch(0.0, moving, sides) for sides in rows])
    np.testing.assert_array_equal(together, alone)
    assert float(together[0, 1]) == 0.0 and float(together[1, 1]) == 1.25
    # the internal state of the element goes on
    assert float(together[0, 3]) != 0.0


@pytest.mark.parametrize("held", [{"rest": (1,)}, {"rests": (3,)}])
def test_what_a_mode_holds_must_exist(held):
    class Wrong(Latched):
        pass

    Wrong.held = held
    with pytest.raises(ValueError, match="held of Wrong"):
        simulate(Wrong(), jnp.zeros(3), 0.0, 1.0)


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
