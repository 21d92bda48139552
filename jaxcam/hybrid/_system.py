"""What a hybrid system is: three functions of time and state, and parameters."""

import abc
from typing import Any, ClassVar, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
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


_Module = TypeVar("_Module", bound=eqx.Module)


def with_array_parameters(system: _Module) -> _Module:
    """The system (or settings) with Python floats turned into arrays.

    A field declared as `stiffness: float = 3.0` is a parameter like any other.
    """
    return jax.tree.map(
        lambda leaf: jnp.asarray(leaf) if type(leaf) is float else leaf, system
    )
