"""What a simulation of a Filippov system returns."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..parameters import VectorLike
from ._step import in_mode
from ._system import FilippovSystem


class Switches(eqx.Module):
    """The events of a motion, in order: crossings, begins and ends of sliding."""

    time: Float[Array, " k"]
    """(k,) s."""
    state: Float[Array, "k n"]
    """(k, n)."""
    before: Int[Array, " k"]
    """(k,) [`Mode`][jaxcam.filippov.modes.Mode] before and after: 1 above, 0 sliding,
    -1 below."""
    after: Int[Array, " k"]

    @property
    def count(self) -> int:
        """How many there are."""
        return self.time.shape[0]


class FilippovTrajectory(eqx.Module):
    """A motion on [t0, t1]."""

    system: FilippovSystem
    t0: Float[Array, ""]
    t1: Float[Array, ""]
    time: Float[Array, " s"]
    """(s,) and (s, n) ends of the steps, and (s,) the mode from there on."""
    state: Float[Array, "s n"]
    mode: Int[Array, " s"]
    switches: Switches
    result: str = eqx.field(static=True)
    """Empty, or why t1 was not reached."""

    @property
    def final(self) -> Float[Array, " n"]:
        """State at the end of the run."""
        return self.state[-1]

    def at(self, times: VectorLike) -> Float[Array, "times n"]:
        """State at each of `times` (s), by one more step from the point before it.

        Raises:
            ValueError: For times outside the run.
        """
        wanted = np.asarray(times, dtype=float)
        known = np.asarray(self.time)
        room = 1e-12 * (1 + abs(known[-1]))
        if wanted.size and not (
            wanted.min() >= known[0] - room and wanted.max() <= known[-1] + room
        ):
            raise ValueError(
                f"times reach from {wanted.min():g} to {wanted.max():g} s but the "
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
        """Begin and end (s) of each interval of sliding within the run."""
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
