"""Define a system whose vector field has several branches, joined at surfaces."""

import abc
import itertools
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ._system import HybridSystem
from ._types import RealScalar, State


class SwitchedSystem(HybridSystem):
    """A system whose vector field changes when the state crosses a surface.

    Subclass it and define two methods. `switching` returns one switching function per
    surface, which is zero on the surface; `branch` returns the rate of change of the
    state for given sides of the surfaces, +1 where the switching function is positive
    and -1 where it is negative. Each branch must remain smooth slightly beyond its
    surfaces. The event loop locates a crossing as accurately as an impact, ends the
    step there and continues with the other branch. A spring force with a corner,
    backlash or a relay therefore causes no loss of accuracy, and crossings have exact
    derivatives.

    There are no constraints by default; define `gap` and `impact` if the system also
    has impacts. With `hysteresis`, a surface switches like a relay; with `reset`, the
    state jumps at a crossing. If both branches point towards a surface, the motion
    slides along it until one of them points away; with dry friction, the body sticks.
    `holding` is then the ratio of static to kinetic friction. `contact_friction` adds
    Coulomb friction to constraints.

    Examples:
        >>> from jaxcam.hybrid import SwitchedSystem
        >>> class SoftStop(SwitchedSystem):
        ...     stiffness: float = 9.0
        ...     def switching(self, t, state):
        ...         return state[0]
        ...     def branch(self, t, state, sides):
        ...         spring = jnp.where(sides[0] > 0, self.stiffness, 1.0)
        ...         return jnp.stack([state[1], -spring * state[0]])
        >>> run = jaxcam.simulate(SoftStop(), [0.0, 1.0], 0.0, 2.0)
        >>> np.asarray(run.switches.time).round(6).tolist()
        [1.047198]
    """

    @abc.abstractmethod
    def switching(
        self, t: RealScalar, state: Float[Array, " n"]
    ) -> Float[Array, "*surfaces"]:
        """Return the switching functions, which are zero on the surfaces.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.

        Returns:
            The value, a scalar, or shape `(k,)` for k surfaces; smooth in time and
                state.
        """

    @abc.abstractmethod
    def branch(
        self, t: RealScalar, state: Float[Array, " n"], sides: Float[Array, " k"]
    ) -> Float[Array, " n"]:
        """Return the rate of change of the state on the given sides of the surfaces.

        Args:
            t: Time (s).
            state: State, shape `(n,)`; possibly a little beyond a surface.
            sides: +1 or -1 for each surface, shape `(k,)`. Use them instead of the sign
                of the switching functions, as in `jnp.where(sides[0] > 0, ...)`.

        Returns:
            Rate of change of the state, shape `(n,)`; smooth in time and state for
            fixed sides.
        """

    def branches(
        self, t: RealScalar, state: State, sides: Float[Array, "rows k"]
    ) -> Float[Array, "rows n"]:
        """Return the rates of change on several combinations of sides.

        Override it if the branches have parts in common that take time to compute.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.
            sides: +1 or -1, one row for each combination, shape `(rows, k)`.

        Returns:
            Rates of change of the state, shape `(rows, n)`.
        """
        return jax.vmap(lambda one: self.branch(t, state, one))(sides)

    def forced(
        self,
        rate: Float[Array, " n"],
        pushed: Float[Array, " n"],
        sides: Float[Array, " k"],
    ) -> Float[Array, " n"]:
        """Return the rate of change with forces that are added to the system.

        Override it if a force has no effect on some sides, because something else holds
        the body there.

        Args:
            rate: Rate of change without the added forces, shape `(n,)`.
            pushed: The same with the forces on all components that they act on, shape
                `(n,)`.
            sides: +1 or -1 for each surface, shape `(k,)`.

        Returns:
            Rate of change of the state, shape `(n,)`: by default, `pushed`.
        """
        del rate, sides
        return pushed

    def distances(
        self, t: RealScalar, state: State, sides: Float[Array, " k"]
    ) -> Float[Array, " k"]:
        """Return the distances of a motion from the surfaces at which it will switch.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.
            sides: +1 or -1 for each surface, shape `(k,)`.

        Returns:
            Positive before a switch and zero at it, shape `(k,)`: by default, the
                switching functions times the sides, plus the hysteresis.
        """
        return sides * jnp.atleast_1d(self.switching(t, state)) + self.hysteresis

    def vector_field(self, t: RealScalar, state: State) -> State:
        """Return the rate of change on the sides that `sides` gives for this state."""
        return self.branch(t, state, self.sides(t, state))

    def gap(self, t: RealScalar, state: State) -> Float[Array, "*constraints"]:
        """Return the gaps: none by default, shape `(0,)`."""
        del t, state
        return jnp.zeros((0,))

    def impact(self, t: RealScalar, state: State) -> Float[Array, "*constraints n"]:
        """Return the states after impacts: none by default, shape `(0, n)`."""
        del t
        return jnp.zeros((0, state.shape[0]))

    def sides(self, t: RealScalar, state: State) -> Float[Array, " k"]:
        """Return the sides on which a motion from this state starts.

        By default, these are the signs of the switching functions. A motion that starts
        on a surface continues on the side that it enters, or slides. If both branches
        point away from the surface, the motion is not unique, and this method
        determines the side. With hysteresis, both sides may be possible; override this
        method to choose one, for example with a field of the system.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.

        Returns:
            +1 or -1 for each surface, shape `(k,)`.
        """
        values = jnp.atleast_1d(self.switching(t, state))
        return jnp.where(values >= 0, 1.0, -1.0)

    @property
    def one_way(self) -> int:
        """Return how many surfaces, which come first, are transitions between modes.

        A motion does not slide along them. It is zero except in a `HybridAutomaton`.
        """
        return 0

    @property
    def remembers(self) -> bool:
        """Return whether the sides depend on the past, and not on the state alone:
        by default, whether there is hysteresis.
        """
        return bool(np.any(np.asarray(self.hysteresis) > 0))

    def sides_changed(self, number: int) -> tuple[tuple[int, ...], ...]:
        """Return, for each surface, the surfaces whose sides change at its crossing.

        Args:
            number: Number of surfaces.

        Returns:
            Indices of surfaces: by default, each surface only changes its own side.
        """
        return tuple((k,) for k in range(number))

    def remembered_sides(self, number: int) -> Int[np.ndarray, "discrete k"]:
        """Return the sides that depend on the past, in each discrete state.

        By default, these are the sides of all surfaces if the class defines a
        `hysteresis`, in every combination; otherwise there is a single discrete state.

        Args:
            number: Number of surfaces, k.

        Returns:
            +1 or -1 for each surface, or 0 if the state determines the side; one row
                for each discrete state.
        """
        if type(self).hysteresis is SwitchedSystem.hysteresis:
            return np.zeros((1, number), dtype=int)
        return np.array(list(itertools.product((1, -1), repeat=number)), dtype=int)

    def met_surfaces(self, number: int) -> Bool[np.ndarray, "discrete k"]:
        """Return which surfaces a motion can cross in each discrete state: by default,
        all.

        Args:
            number: Number of surfaces, k.

        Returns:
            One row for each discrete state of `remembered_sides`.
        """
        return np.ones_like(self.remembered_sides(number), dtype=bool)

    @property
    def hysteresis(self) -> Any:
        """Return how far a switching function goes beyond zero before the side changes.

        The result is a number or has shape `(k,)`; the default is zero. A motion on the
        positive side switches where the function falls to -hysteresis, and a motion on
        the negative side where it rises to +hysteresis, as in a relay.
        """
        return 0.0

    @property
    def holding(self) -> Any:
        """Return the ratio of static to kinetic friction at each surface.

        This is the largest friction force at zero slip divided by the friction force in
        the branches. The ratio must be at least one; it is a number or has shape
        `(k,)`, and the default is one.
        """
        return 1.0

    @property
    def restitution_kind(
        self,
    ) -> Literal["kinematic", "kinetic", "energetic", "complementarity"]:
        """Return the meaning of the coefficient of restitution with contact friction.

        `"kinematic"` (Newton, the default): ratio of the normal velocities after and
        before the impact. `"kinetic"` (Poisson): ratio of the normal impulses in
        restitution and in compression. `"energetic"` (Stronge): square root of the
        ratio of the work of the normal force in restitution to that in compression;
        only with this definition can an impact never increase the energy. These three
        definitions differ if friction changes the normal velocity and the slip stops or
        reverses during the impact. `"complementarity"` (Moreau): ratio of the normal
        velocities, with all of the friction acting against the slip after the impact,
        as in time-stepping schemes; the result differs if the slip reverses.

        In systems with up to three constraints and more than three states, an impact
        that occurs while other gaps are closed is treated as an impact on all
        constraints whose gaps are closed. The coefficient is then Newton's for
        `"kinematic"` and `"complementarity"`, otherwise Poisson's.
        """
        return "kinematic"

    @property
    def has_contact_friction(self) -> bool:
        """Return whether the contacts have friction, that is, whether the class defines
        `contact_friction`.

        Override this property in a class whose `contact_friction` calls that of another
        system.
        """
        return type(self).contact_friction is not SwitchedSystem.contact_friction

    def contact_friction(
        self, t: RealScalar, state: State, sides: Float[Array, " k"]
    ) -> Float[Array, "*constraints n"]:
        """Return the friction of each contact, per unit of its normal force: none by
        default.

        While a constraint is in contact, each unit of its normal force adds the impulse
        direction plus this vector to the rates of the state. For a body with friction
        coefficient mu that slides along x, with its slip velocity as the first
        switching function, the only nonzero component is that of the velocity along x:
        `-mu * sides[0]`. At zero slip the body sticks as long as the required friction
        force is less than mu times the normal force. `impact` is then the law without
        friction, from which the coefficient of restitution follows; `restitution_kind`
        defines this coefficient. During an impact, the body slips until friction has
        stopped it; then it sticks, or slips back if friction is too weak. The friction
        of a constraint must oppose one slip velocity, which must be one of the
        switching functions.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.
            sides: +1 or -1 for each surface, shape `(k,)`.

        Returns:
            Changes of the rates per unit of normal acceleration due to the contact,
                shape `(n,)`, or `(m, n)` for m constraints.
        """
        del sides
        return jnp.zeros((*jnp.shape(self.gap(t, state)), *state.shape))

    def reset(
        self, t: RealScalar, state: State, sides: Float[Array, " k"]
    ) -> Float[Array, "*surfaces n"]:
        """Return the state just after the crossing of each surface: unchanged by
        default.

        Args:
            t: Time (s).
            state: State at the crossing, shape `(n,)`.
            sides: Sides before the crossing, shape `(k,)`.

        Returns:
            State after the crossing, shape `(n,)`, for a scalar `switching`; otherwise
                one row per surface, shape `(k, n)`.
        """
        del sides
        shape = jnp.shape(self.switching(t, state))
        return jnp.broadcast_to(state, (*shape, *state.shape))
