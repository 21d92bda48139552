"""What a simulation returns: impacts, contacts, and the state at any time."""

from html import escape

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._settings import Settings
from .._system import HybridSystem
from ..checks import is_traced, is_tracing, refuse_tracers
from ..codes import message
from ..surface import gaps
from ._events import Contacts, Impacts, Steps
from ._sample import pad, padded, sample
from ._section import crossings


class Trajectory(eqx.Module):
    """A trajectory of a hybrid system on [t0, t1]."""

    system: HybridSystem
    settings: Settings
    t0: Float[Array, ""]
    t1: Float[Array, ""]
    impacts: Impacts
    contacts: Contacts
    steps: Steps
    #: index into `RESULTS`: 0 successful
    code: Int[Array, ""]

    def __str__(self) -> str:
        # of a batch there is no one line
        if is_traced(self) or np.ndim(self.code):
            return repr(self)
        end = float(np.asarray(self.steps.time)[int(self.steps.count) - 1])
        said = (
            f"{type(self.system).__name__} from {float(self.t0):g} to {end:g} s, "
            f"impacts: {int(self.impacts.count)}, contacts: {int(self.contacts.count)}"
        )
        return f"{said}. {self.result}" if self.result else said

    def _repr_html_(self) -> str | None:
        batch = is_traced(self) or np.ndim(self.code)
        return None if batch else f"<p>{escape(str(self))}</p>"

    @property
    def successful(self):
        """Whether the trajectory reached t1."""
        return self.code == 0

    @property
    def result(self) -> str:
        """A sentence when the run did not reach t1, else the empty string."""
        return message(int(self.code))

    @property
    def final(self) -> Float[Array, " n"]:
        """State at the end of the run; NaN under a transformation if it failed."""
        if not is_traced(self):
            last = np.asarray(self.steps.state)[int(self.steps.count) - 1]
            return jax.device_put(last)
        last = self.steps.state[self.steps.count - 1]
        return jnp.where(self.code == 0, last, jnp.nan)

    def at(self, times) -> Float[Array, "times n"]:
        """State at each of `times` (s, shape `(times,)`), after any impact there.

        Each sample is one more step of the same method from the last point before it,
        so it is as accurate as the run itself and differentiable.

        **Raises:** `ValueError` for times outside [t0, t1].
        """
        known = not (is_traced((self, times)) or is_tracing())
        # in numpy where it can be: jax would compile something for every new length
        xp = np if known else jnp
        times = xp.asarray(times, dtype=xp.float64)
        if times.ndim != 1:
            raise ValueError(
                f"times has shape {times.shape}; pass a vector, such as "
                "jnp.linspace(t0, t1, 100) or jnp.array([t])"
            )
        if known and times.size:
            low, high = float(times.min()), float(times.max())
            end = float(np.asarray(self.steps.time)[int(self.steps.count) - 1])
            room = 1e-12 * max(abs(float(self.t0)), abs(end))
            if not (low >= float(self.t0) - room and high <= end + room):
                raise ValueError(
                    f"times reach from {low:g} to {high:g} s but the trajectory covers "
                    f"{float(self.t0):g} to {end:g} s"
                )
        if not known:
            return sample(self.system, self.settings, self.steps, times)
        steps, longer = padded(self.steps), pad(times, np.nan)
        found = sample(self.system, self.settings, steps, longer)
        return jax.device_put(np.asarray(found)[: times.shape[0]].copy())

    def gap(self, times):
        """Gap at each of `times`: shape `(times,)`, or `(times, m)` for m > 1."""
        states = self.at(times)
        if is_traced((self, times)) or is_tracing():
            return _gaps(self.system, jnp.asarray(times, dtype=jnp.float64), states)
        times, states = np.asarray(times), np.asarray(states)
        found = _gaps(self.system, pad(times, np.nan), pad(states, np.nan))
        return jax.device_put(np.asarray(found)[: len(times)].copy())

    def stroboscopic(self, period=None, phase=0.0) -> Float[Array, "k n"]:
        """States at t0 + phase + k period, for a period (s) or the forcing's own.

        **Raises:** `ValueError` where the system has no period and none is given.
        """
        refuse_tracers("stroboscopic", "trajectory.at(times)", self, period, phase)
        period = self.system.period if period is None else period
        if period is None:
            raise ValueError(
                "this system has no forcing period; pass one: stroboscopic(period=...)"
            )
        start, end = float(self.t0) + float(phase), float(self.t1)
        number = int((end - start) / float(period) * (1 + 1e-12)) + 1
        times = start + np.arange(number) * float(period)
        return self.at(np.minimum(times, end))

    def section(self, function, direction: int = 0):
        """Crossings of a Poincare section `function(t, state) = 0`.

        **Arguments:** a smooth scalar function, and the direction of the crossings that
        count: +1 rising, -1 falling, 0 both. Each step of the integration is searched
        in eight pieces; two crossings within one piece are missed.

        **Returns:** times (s) and states, shapes `(k,)` and `(k, n)`.
        """
        refuse_tracers("section", "trajectory.at(times)", self)
        return crossings(self, function, direction)


@eqx.filter_jit
def _gaps(system, times, states):
    values = jax.vmap(lambda t, x: gaps(system, t, x))(times, states)
    return values[:, 0] if values.shape[1] == 1 else values
