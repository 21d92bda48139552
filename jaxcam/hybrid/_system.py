"""A hybrid system, defined by its parameters and functions of time and state."""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._types import RealScalar


class HybridSystem(eqx.Module):
    """A mechanical system with impacts: free flight between impacts on its constraints.

    Subclass it, define the methods below, and declare the parameters as fields:
    every floating-point field is a parameter. A `where` function, such as
    `lambda s: s.speed`, selects a parameter to sweep, to fit, to continue, or to
    differentiate with respect to.

    The methods take the time `t` (seconds, a scalar) and the state (shape
    `(n,)`), must be smooth in both, and are written with `jax.numpy`. With one
    constraint, `gap` returns a scalar; with `m` constraints, it returns shape `(m,)`
    and `impact` returns shape `(m, n)`, one row for each constraint. Without
    constraints, only `vector_field` is needed.

    Everything else (normal velocity, acceleration and jerk of the gap, the sticking
    field, release and the completion of chatter) is derived from these functions by
    automatic differentiation.

    Examples:
        >>> class Ball(jaxcam.HybridSystem):
        ...     restitution: float = 0.8
        ...     def vector_field(self, t, state):
        ...         return jnp.stack([state[1], -9.81])
        ...     def gap(self, t, state):
        ...         return state[0]
        ...     def impact(self, t, state):
        ...         return jnp.stack([state[0], -self.restitution * state[1]])
        >>> int(jaxcam.simulate(Ball(), [1.0, 0.0], 0.0, 1.0).impacts.count)
        1
    """

    state_names: ClassVar[tuple[str, ...]] = ()
    """Names of the state components, used in tables and axis labels."""
    state_units: ClassVar[tuple[str, ...]] = ()
    """Units of the state components, used in tables and axis labels."""
    constraint_names: ClassVar[tuple[str, ...]] = ()
    """Names of the constraints, in the order of `gap`, such as `("left", "right")`."""
    active: ClassVar[bool] = False
    """Whether impacts may add energy, as with a driven bumper or in reversed time.
    Otherwise, a coefficient of restitution above one is an error.
    """
    steep: ClassVar[bool] = False
    """Whether a force changes steeply with the state, as smoothed dry friction does. A
    fit to recordings with a measured input then takes steps as short as their samples.
    """

    @abc.abstractmethod
    def vector_field(
        self, t: RealScalar, state: Float[Array, " n"]
    ) -> Float[Array, " n"]:
        """Return the rate of change of the state in free flight (thesis, eq. 2.24).

        Args:
            t: Time (s).
            state: State, shape `(n,)`.

        Returns:
            Rate of change of the state, shape `(n,)`.
        """

    def gap(
        self, t: RealScalar, state: Float[Array, " n"]
    ) -> Float[Array, "*constraints"]:
        """Return the gap: positive in flight, zero in contact (thesis, eq. 2.23).

        By default, it is always one: there are no constraints.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.

        Returns:
            The gap, a scalar, or shape `(m,)` for m constraints.
        """
        del state
        return jnp.ones(jnp.shape(t))

    def impact(
        self, t: RealScalar, state: Float[Array, " n"]
    ) -> Float[Array, "*constraints n"]:
        """Return the state just after an impact, given the `state` just before it.

        It must have the form `state + W(t, state) * normal_velocity` (thesis, eq.
        2.27), so that a grazing state is unchanged. With a coefficient of restitution
        r, the normal velocity is multiplied by -r.

        Args:
            t: Time (s).
            state: State just before the impact, shape `(n,)`.

        Returns:
            State after the impact, shape `(n,)`, or one row per constraint, shape
                `(m, n)`. By default, the state is unchanged.
        """
        del t
        return state

    @property
    def period(self) -> Any:
        """Return the period of the forcing (s), or `None` for an autonomous system."""
        return None

    @property
    def breakpoints(self) -> Any:
        """Return the times at which a function may change abruptly (s), or `None`.

        The shape is `(k,)`. Steps end exactly at these times, so within a step the
        vector field, gap and impact law are evaluated on only one side of each time
        `b`, and a switch may be written with `jnp.where(t < b, ...)`. In a system with
        a `period`, these times repeat in every period, at `b + i * period` for every
        integer i. Declare a brief force by the times at which it begins and ends. Keep
        the number small, because each time adds operations to every step.
        """
        return None

    def constraint_name(self, number: int) -> str:
        """Return the name of a constraint, by default `constraint 0` and so on."""
        names = self.constraint_names
        return names[number] if number < len(names) else f"constraint {number}"

    def prepared(self) -> "HybridSystem":
        """Return an equivalent system that is cheaper to evaluate many times.

        This method is called once before each simulation, and derivatives are
        propagated through it. For example, a cam profile is replaced here by its
        Fourier coefficients.

        Returns:
            The equivalent system; by default, the system itself.
        """
        return self

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value.

        It is called with concrete parameters before a simulation starts.
        """
        return None
