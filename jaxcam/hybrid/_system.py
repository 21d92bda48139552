"""What a hybrid system is: three functions of time and state, and parameters."""

import abc
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from ._types import RealScalar


class HybridSystem(eqx.Module):
    """A mechanical system that flies freely until it hits something.

    Subclass it, state the three methods below, and declare the parameters as fields:
    every floating-point field is a parameter that can be swept, fitted, followed and
    differentiated, and is picked with a `where` function (`lambda s: s.speed`).

    All three methods take the time `t` (seconds, a scalar) and the state (shape
    `(n,)`), are smooth in both, and are written with `jax.numpy`. With one constraint
    `gap` returns a scalar; with `m` constraints it returns shape `(m,)` and `impact`
    returns shape `(m, n)`, one row for each constraint.

    Everything else (normal velocity, acceleration and jerk of the gap, the sticking
    field, release, the completion of chatter) is derived from them by automatic
    differentiation.
    """

    #: names and units of the state's components, for tables and axes
    state_names: ClassVar[tuple[str, ...]] = ()
    state_units: ClassVar[tuple[str, ...]] = ()
    #: names of the constraints, in the order of `gap`, such as `("left", "right")`
    constraint_names: ClassVar[tuple[str, ...]] = ()
    #: whether impacts may give speed, as at a driven bumper or where time runs
    #: backwards; otherwise a coefficient of restitution above one is refused
    active: ClassVar[bool] = False

    @abc.abstractmethod
    def vector_field(
        self, t: RealScalar, state: Float[Array, " n"]
    ) -> Float[Array, " n"]:
        """Rate of change of the state in free flight, shape `(n,)`. (2.24)"""

    @abc.abstractmethod
    def gap(
        self, t: RealScalar, state: Float[Array, " n"]
    ) -> Float[Array, "*constraints"]:
        """Distance to the constraint: positive outside, zero in contact. (2.23)"""

    @abc.abstractmethod
    def impact(
        self, t: RealScalar, state: Float[Array, " n"]
    ) -> Float[Array, "*constraints n"]:
        """State just after an impact that found the system in `state`.

        It must have the form `state + W(t, state) * normal_velocity` (2.27): a grazing
        state is left alone. With restitution r the normal velocity is multiplied
        by -r.
        """

    @property
    def period(self) -> Any:
        """Period of the forcing (s), or `None` for a system without one."""
        return None

    @property
    def breakpoints(self) -> Any:
        """Times at which a function may change abruptly (s), shape `(k,)`, or `None`.

        Steps end exactly there, and the field, gap and impact law are evaluated on
        either side only, so that a switch may be written with `jnp.where(t < b, ...)`.
        A system with a `period` has them in every period, at `b + k * period`; without
        one they are times of the run. State a brief force by the times at which it
        begins and ends; a few, as each costs some operations in every step.
        """
        return None

    def constraint_name(self, number: int) -> str:
        """Name of a constraint, or `constraint 1` where the system names none."""
        names = self.constraint_names
        return names[number] if number < len(names) else f"constraint {number}"

    def prepared(self) -> "HybridSystem":
        """An equal system that is cheaper to evaluate many times.

        Called once before a simulation, and differentiated through. For example, a cam
        profile replaces its geometry by Fourier coefficients here.
        """
        return self

    def check(self) -> None:
        """Raise `ValueError` where a parameter has no physical meaning.

        Called with concrete parameters, before a simulation starts.
        """
        return None
