"""The result of a simulation of a Filippov system."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..parameters import VectorLike
from ._step import in_mode
from ._system import FilippovSystem


class Switches(eqx.Module):
    """The switches of a trajectory, in order: crossings, and the start and end of
    sliding.
    """

    time: Float[Array, " k"]
    """Time of each switch (s), shape `(k,)`."""
    state: Float[Array, "k n"]
    """State at each switch, shape `(k, n)`."""
    before: Int[Array, " k"]
    """Mode before each switch: 1 above, 0 sliding, -1 below; shape `(k,)`."""
    after: Int[Array, " k"]
    """Mode after each switch, shape `(k,)`."""

    @property
    def count(self) -> int:
        """Number of switches."""
        return self.time.shape[0]


class FilippovTrajectory(eqx.Module):
    """A trajectory of a Filippov system on [t0, t1].

    Examples:
        >>> from jaxcam.filippov import simulate_filippov
        >>> from jaxcam.models import BeltOscillator
        >>> run = simulate_filippov(BeltOscillator(), [1.0, 0.0], 0.0, 1.0)
        >>> run.at([0.0, 0.5]).shape
        (2, 2)
    """

    system: FilippovSystem
    """The simulated system."""
    t0: Float[Array, ""]
    """Start time (s)."""
    t1: Float[Array, ""]
    """End time (s)."""
    time: Float[Array, " s"]
    """Times at the ends of the steps (s), shape `(s,)`."""
    state: Float[Array, "s n"]
    """States at these times, shape `(s, n)`."""
    mode: Int[Array, " s"]
    """Mode after each of these times: 1 above, 0 sliding, -1 below; shape `(s,)`."""
    switches: Switches
    """The switches, in order."""
    result: str = eqx.field(static=True)
    """The reason why t1 was not reached; empty if it was."""

    @property
    def final(self) -> Float[Array, " n"]:
        """State at the end of the trajectory."""
        return self.state[-1]

    def at(self, times: VectorLike) -> Float[Array, "times n"]:
        """Return the state at each of `times` (s), by one additional step from the
        point before it.

        Args:
            times: Times (s), shape `(times,)`.

        Returns:
            States, shape `(times, n)`.

        Raises:
            ValueError: A time is outside the trajectory.
        """
        wanted = np.asarray(times, dtype=float)
        known = np.asarray(self.time)
        room = 1e-12 * (1 + abs(known[-1]))
        if wanted.size and not (
            wanted.min() >= known[0] - room and wanted.max() <= known[-1] + room
        ):
            raise ValueError(
                f"times extend from {wanted.min():g} to {wanted.max():g} s, but the "
                f"trajectory covers {known[0]:g} to {known[-1]:g} s"
            )
        k = np.clip(np.searchsorted(known, wanted, side="right") - 1, 0, len(known) - 1)
        mode = np.asarray(self.mode, dtype=float)[k]
        return _sample(
            self.system,
            jnp.asarray(mode),
            jnp.asarray(known[k]),
            self.state[k],
            jnp.asarray(wanted - known[k]),
        )

    def sliding(self) -> Float[Array, "intervals 2"]:
        """Return the start and end (s) of each sliding interval, shape `(intervals,
        2)`.
        """
        mode, time = np.asarray(self.mode), np.asarray(self.time)
        held = mode == 0
        begins = np.flatnonzero(held & ~np.append(False, held[:-1]))
        ends = np.flatnonzero(~held & np.append(False, held[:-1]))
        ends = np.append(ends, len(time) - 1)[: len(begins)]
        return jnp.asarray(np.stack([time[begins], time[ends]], axis=1))


@eqx.filter_jit
def _sample(system, modes, times, states, lengths):
    def one(mode, t, x, h):
        return in_mode(system, mode, t, x, h)[0]

    return jax.vmap(one)(modes, times, states, lengths)
