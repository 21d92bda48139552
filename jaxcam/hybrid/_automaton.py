"""Define a hybrid automaton: named modes and transitions between them."""

import abc
from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ._switched import SwitchedSystem
from ._types import RealScalar, State


class HybridAutomaton(SwitchedSystem):
    """A system with named modes, each with its own vector field, and transitions.

    Subclass it, list the names of the `modes` and the `transitions`, and define two
    methods: `fields` returns the vector field of every mode, and `guards` one function
    for every transition. A transition takes place where its guard falls to zero while
    the motion is in the mode from which the transition starts; in other modes, the
    guard has no effect. With `resets`, the state jumps. If a guard is already negative
    when its mode begins, the transition takes place at once. A clutch, a relay with two
    thresholds, a valve with a latch or a stick-slip law with a breakaway force can be
    stated in this way.

    Transitions are located as accurately as impacts, and have exact derivatives. In
    every mode, the motion may also cross or slide along the surfaces that `surfaces`
    returns, as those of a `SwitchedSystem`, and have impacts and contact friction. A
    motion starts in the mode `start_mode`.

    Examples:
        >>> from jaxcam.hybrid import HybridAutomaton
        >>> class Thermostat(HybridAutomaton):
        ...     modes = ("heating", "cooling")
        ...     transitions = (("heating", "cooling"), ("cooling", "heating"))
        ...     warm: float = 22.0
        ...     cold: float = 18.0
        ...     def fields(self, t, state, sides):
        ...         return jnp.stack([30.0 - state, 10.0 - state])
        ...     def guards(self, t, state):
        ...         return jnp.stack([self.warm - state[0], state[0] - self.cold])
        >>> run = jaxcam.simulate(Thermostat(), [20.0], 0.0, 1.0)
        >>> run.modes.names()
        ['heating', 'cooling', 'heating']
        >>> np.asarray(run.modes.end).round(6).tolist()  # ln(10 / 8), + ln(12 / 8), ...
        [0.223144, 0.628609, 1.0]
    """

    modes: ClassVar[tuple[str, ...]]
    """Names of the modes."""
    transitions: ClassVar[tuple[tuple[str, str], ...]]
    """For each transition, the names of the modes before and after it."""
    held: ClassVar[Mapping[str, tuple[int, ...]]] = {}
    """For each mode in which something holds velocities, such as a latch or a brake,
    their indices in the state: forces that a diagnosis adds do not change them.
    """

    @abc.abstractmethod
    def fields(
        self, t: RealScalar, state: Float[Array, " n"], sides: Float[Array, " s"]
    ) -> Float[Array, "modes n"]:
        """Return the rate of change of the state in each mode.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.
            sides: +1 or -1 for each of the `surfaces`, shape `(s,)`; empty by default.

        Returns:
            Rates of change of the state, one row for each mode, shape `(modes, n)`;
                each row is smooth in time and state for fixed sides.
        """

    @abc.abstractmethod
    def guards(
        self, t: RealScalar, state: Float[Array, " n"]
    ) -> Float[Array, " transitions"]:
        """Return the guards, each of which falls to zero where its transition occurs.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.

        Returns:
            One value for each transition, shape `(transitions,)`; smooth in time and
                state.
        """

    def resets(self, t: RealScalar, state: State) -> Float[Array, "transitions n"]:
        """Return the state just after each transition: unchanged by default.

        Args:
            t: Time (s).
            state: State at the transition, shape `(n,)`.

        Returns:
            One row for each transition, shape `(transitions, n)`.
        """
        del t
        return jnp.broadcast_to(state, (len(self.transitions), *state.shape))

    def surfaces(self, t: RealScalar, state: State) -> Float[Array, " s"]:
        """Return further switching functions, whose sides `fields` takes: none by
        default.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.

        Returns:
            Switching functions as those of a `SwitchedSystem`, shape `(s,)`.
        """
        del t, state
        return jnp.zeros((0,))

    def start_mode(self, t: RealScalar, state: State) -> Int[Array, ""]:
        """Return the index of the mode in which a motion from this state starts.

        By default, it is the first mode. Override this method if the state determines
        the mode, or to choose it with a field of the system.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.

        Returns:
            Index into `modes`, a scalar.
        """
        del t, state
        return jnp.asarray(0)

    def mode(self, sides: Float[Array, " k"]) -> Int[Array, ""]:
        """Return the index of the mode that is stored in the sides.

        Use it in `contact_friction`, which takes the sides of all surfaces.

        Args:
            sides: +1 or -1 for each transition, then for each of the `surfaces`, as in
                `trajectory.steps.sides`, shape `(k,)`.

        Returns:
            Index into `modes`, a scalar.
        """
        flags = [jnp.where(sides[bit] < 0, 2**bit, 0) for bit in range(self._bits)]
        return sum(flags, jnp.asarray(0))

    def switching(self, t: RealScalar, state: State) -> Float[Array, " k"]:
        """Return the guards, then the `surfaces`, shape `(k,)`."""
        guards = jnp.atleast_1d(self.guards(t, state))
        return jnp.concatenate([guards, jnp.atleast_1d(self.surfaces(t, state))])

    def distances(
        self, t: RealScalar, state: State, sides: Float[Array, " k"]
    ) -> Float[Array, " k"]:
        """Return the guards of the present mode, and the distances from the `surfaces`.

        The guards of other modes are replaced by zero, which never changes.
        """
        number, present = self.one_way, self.mode(sides)
        values = super().distances(t, state, sides)
        guards = jnp.atleast_1d(self.guards(t, state))
        starts = [self.modes.index(before) for before, _ in self.transitions]
        counted = [
            jnp.where(present == s, guards[k], 0.0) for k, s in enumerate(starts)
        ]
        return jnp.concatenate([jnp.stack(counted), values[number:]])

    def branch(
        self, t: RealScalar, state: State, sides: Float[Array, " k"]
    ) -> Float[Array, " n"]:
        """Return the rate of change of the state in the present mode."""
        rows = self.fields(t, state, sides[self.one_way :])
        present, found = self.mode(sides), rows[0]
        for i in range(1, len(self.modes)):
            found = jnp.where(present == i, rows[i], found)
        return found

    def forced(
        self,
        rate: Float[Array, " n"],
        pushed: Float[Array, " n"],
        sides: Float[Array, " k"],
    ) -> Float[Array, " n"]:
        """Return the rate of change with added forces, except for velocities that the
        present mode holds.
        """
        present = self.mode(sides)
        for mode, places in self.held.items():
            inside = present == self.modes.index(mode)
            for k in places:
                pushed = pushed.at[k].set(jnp.where(inside, rate[k], pushed[k]))
        return pushed

    def reset(
        self, t: RealScalar, state: State, sides: Float[Array, " k"]
    ) -> Float[Array, "k n"]:
        """Return the state after each transition, and unchanged at the `surfaces`."""
        number = sides.shape[0] - self.one_way
        kept = jnp.broadcast_to(state, (number, *state.shape))
        return jnp.concatenate([jnp.atleast_2d(self.resets(t, state)), kept])

    def sides(self, t: RealScalar, state: State) -> Float[Array, " k"]:
        """Return the sides on which a motion starts, which contain its mode."""
        start = jnp.asarray(self.start_mode(t, state))
        bits = [start // 2**bit % 2 > 0 for bit in range(self._bits)]
        unused = [jnp.asarray(False)] * (self.one_way - self._bits)
        code = jnp.where(jnp.stack([*bits, *unused]), -1.0, 1.0)
        own = jnp.atleast_1d(self.surfaces(t, state))
        return jnp.concatenate([code, jnp.where(own >= 0, 1.0, -1.0)])

    @property
    def one_way(self) -> int:
        """Return the number of transitions."""
        return len(self.transitions)

    @property
    def remembers(self) -> bool:
        """Return True: the mode depends on the past."""
        return True

    def sides_changed(self, number: int) -> tuple[tuple[int, ...], ...]:
        """Return, for each surface, the surfaces whose sides change at its crossing.

        The first sides are the binary digits of the index of the mode.
        """
        found = []
        for before, after in self.transitions:
            digits = self.modes.index(before) ^ self.modes.index(after)
            found.append(tuple(b for b in range(self._bits) if digits >> b & 1))
        return (*found, *((k,) for k in range(self.one_way, number)))

    def remembered_sides(self, number: int) -> Int[np.ndarray, "discrete k"]:
        """Return the sides that depend on the past, in each discrete state: those that
        store the mode, and those of `surfaces` with hysteresis.
        """
        others = super().remembered_sides(number - self.one_way)
        # the first sides are the binary digits of the index of the mode
        digits = np.arange(len(self.modes))[:, None] >> np.arange(self.one_way) & 1
        return np.concatenate(
            [
                np.repeat(1 - 2 * digits, len(others), axis=0),
                np.tile(others, (len(self.modes), 1)),
            ],
            axis=1,
        )

    def met_surfaces(self, number: int) -> Bool[np.ndarray, "discrete k"]:
        """Return which surfaces a motion can cross in each discrete state: the
        transitions that start from its mode, and all `surfaces`.
        """
        others = super().remembered_sides(number - self.one_way)
        starts = np.array([self.modes.index(before) for before, _ in self.transitions])
        starting = starts == np.arange(len(self.modes))[:, None]
        rows = np.repeat(starting, len(others), axis=0)
        rest = np.ones((len(rows), number - self.one_way), dtype=bool)
        return np.concatenate([rows, rest], axis=1)

    @property
    def _bits(self) -> int:
        """The number of binary digits of the index of a mode."""
        return (len(self.modes) - 1).bit_length()
