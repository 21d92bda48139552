"""Systems around another system keep what that declares."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem, simulate
from jaxcam.discrepancy.terms import (
    Relaxation,
    SwitchedWithHidden,
    SwitchedWithTerms,
    WithHidden,
    WithTerms,
)
from jaxcam.hybrid import SwitchedSystem
from jaxcam.hybrid.sections import with_section
from jaxcam.hybrid.surface import OnSides
from jaxcam.recordings import Wandering
from variational import Reversed


JUMP = 0.3


class Declaring(HybridSystem):
    """Every declaration differs from the default of `HybridSystem`; a unit force acts
    from the breakpoint on.
    """

    speed: float = 2.0
    phase: float = 0.0
    restitution: float = 0.8

    state_names = ("position", "velocity")
    state_units = ("m", "m/s")
    constraint_names = ("left",)
    active = True

    @property
    def period(self):
        return 2 * jnp.pi / self.speed

    @property
    def breakpoints(self):
        return jnp.array([JUMP])

    def constraint_name(self, number: int) -> str:
        return f"the wall called {number}"

    def vector_field(self, t, state):
        return jnp.stack([state[1], jnp.where(t < JUMP, 0.0, 1.0)])

    def gap(self, t, state):
        return state[0] + 10.0

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])

    def check(self):
        raise ValueError("checked")


class Branching(Declaring, SwitchedSystem):
    def switching(self, t, state):
        return state[0] + 5.0

    def branch(self, t, state, sides):
        return Declaring.vector_field(self, t, state)


BASE, SWITCHED = Declaring(), Branching()
WRAPPED = {
    "Wandering": Wandering(BASE),
    "Reversed": Reversed(BASE),
    "WithTerms": WithTerms(BASE),
    "WithHidden": WithHidden(BASE, Relaxation()),
    "SwitchedWithTerms": SwitchedWithTerms(SWITCHED),
    "SwitchedWithHidden": SwitchedWithHidden(SWITCHED, Relaxation()),
    "OnSides": OnSides(SWITCHED, jnp.array([False])),
    "WithSection": with_section(BASE, lambda t, x: x[1], 1, 2),
}


@pytest.mark.parametrize("name", WRAPPED)
def test_every_declaration_is_forwarded(name):
    wrapped = WRAPPED[name]
    sign = -1 if name == "Reversed" else 1
    assert wrapped.period == BASE.period
    assert wrapped.breakpoints.tolist() == [sign * JUMP]
    assert wrapped.active
    assert wrapped.constraint_name(3) == "the wall called 3"
    assert wrapped.constraint_names == ("left",)
    # a hidden element adds its own states behind those of the system
    assert wrapped.state_names[:2] == BASE.state_names
    assert wrapped.state_units[:2] == BASE.state_units
    with pytest.raises(ValueError, match="checked"):
        wrapped.check()


class Profiled(Declaring):
    ready: bool = eqx.field(default=False, static=True)

    def prepared(self):
        return Profiled(self.speed, self.phase, self.restitution, True)

    def check(self):
        pass


@pytest.mark.parametrize(
    "wrap",
    [
        Wandering,
        Reversed,
        WithTerms,
        lambda base: WithHidden(base, Relaxation()),
        lambda base: with_section(base, lambda t, x: x[1], 1, 2),
    ],
    ids=["Wandering", "Reversed", "WithTerms", "WithHidden", "WithSection"],
)
def test_the_system_inside_is_prepared(wrap):
    wrapped = wrap(Profiled())
    ready = wrapped.prepared()
    assert type(ready) is type(wrapped)
    assert ready.inner.ready and not wrapped.inner.ready


@pytest.mark.parametrize("wrap", [Wandering, Reversed])
def test_a_declared_jump_ends_a_step(wrap):
    """The velocity gained is the time after the jump, to rounding: no step reaches
    across it.
    """
    sign = -1.0 if wrap is Reversed else 1.0
    start, end = (-1.0, 0.0) if wrap is Reversed else (0.0, 1.0)
    run = simulate(wrap(Profiled()), [0.0, 0.0], start, end, tolerance=1e-3)
    gained = -(1.0 - JUMP) if wrap is Reversed else 1.0 - JUMP
    assert float(run.final[1]) == pytest.approx(gained, abs=1e-12)
    assert np.min(np.abs(run.steps.time - sign * JUMP)) < 1e-12
