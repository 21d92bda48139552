"""Sample any Poincaré section, one trajectory at a time."""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ...hybrid import HybridSystem, Settings, simulate
from ._hybrid_lanes import admissible
from ._samples import BEHIND, Samples
from ._system_section import AbstractSystemSection


class PoincareSection(AbstractSystemSection):
    """Poincaré section: crossings of `function(t, state) = 0`, with their times.

    Motions are computed one after the other by
    [`jaxcam.simulate`][jaxcam.hybrid.simulate], which is suitable for dozens of motions
    but slow for thousands.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from jaxcam.sweeps import PoincareSection
        >>> PoincareSection(ImpactOscillator(), lambda t, state: state[1]).direction
        1
    """

    system: HybridSystem
    """A [`jaxcam.hybrid.HybridSystem`][]."""
    function: Callable = eqx.field(static=True)
    """Smooth scalar function of time and state, written with `jax.numpy`."""
    direction: int = eqx.field(default=1, static=True)
    """+1 for rising crossings, -1 for falling ones, 0 for both."""
    t0: float = 0.0
    """Start time (s)."""
    period: float | None = None
    """Length of a period (s); default: the forcing period of the system."""
    settings: Settings | None = None
    """Accuracy settings; default: those of `simulate`."""
    regular: bool = eqx.field(default=False, static=True, init=False)
    """Samples are not one period apart."""
    impacting: bool = eqx.field(default=True, static=True, init=False)
    """Impacts are counted."""

    def sample(self, states, turns, keep, *, where=None, values=None) -> Samples:
        states = np.asarray(states, dtype=float)
        lanes, n = states.shape
        lengths = np.broadcast_to(self.turn(where, values), (lanes,))
        ready = admissible(self.system, self.t0, states, where, values)
        made = Samples(
            states=np.full((lanes, keep, n), np.nan),
            times=np.full((lanes, keep), np.nan),
            hits=np.zeros((lanes, keep), dtype=int),
            rests=np.zeros((lanes, keep), dtype=int),
            final=np.full((lanes, n), np.nan),
            contact=np.zeros(lanes, dtype=bool),
            code=np.where(ready, 0, BEHIND),
        )
        for lane in np.flatnonzero(ready):
            system = self._system(where, None if values is None else values[lane])
            t1 = self.t0 + turns * lengths[lane]
            self._one(system, states[lane], t1, int(lane), made)
        return made

    def _system(self, where, value) -> HybridSystem:
        if where is None:
            return self.system
        value = jnp.asarray(value, dtype=jnp.float64)
        several = isinstance(where(self.system), tuple)
        return eqx.tree_at(where, self.system, tuple(value) if several else value)

    def _one(self, system, state, t1, lane: int, made: Samples) -> None:
        keep = made.states.shape[1]
        run = simulate(system, state, self.t0, t1, settings=self.settings)
        made.code[lane] = int(run.code)
        if made.code[lane] != 0:
            return
        times, states = map(np.asarray, run.section(self.function, self.direction))
        hits = np.asarray(run.impacts.time)
        rests = np.asarray(run.contacts.start)[1:]
        first = np.asarray(run.contacts.start)[:1]
        rests = np.concatenate([first[first > self.t0], rests])
        edges = np.concatenate([[self.t0], times])
        count = min(keep, len(times))
        if count:
            made.states[lane, -count:] = states[-count:]
            made.times[lane, -count:] = times[-count:]
            made.hits[lane, -count:] = np.histogram(hits, edges)[0][-count:]
            made.rests[lane, -count:] = np.histogram(rests, edges)[0][-count:]
        made.final[lane] = np.asarray(run.final)


def return_times(samples: Samples) -> np.ndarray:
    """Return the times between consecutive points on a section.

    Args:
        samples: Samples of a section.

    Returns:
        Times (s, or iterations of a map), shape `(motions, keep - 1)`; NaN where a
            point is missing.

    Examples:
        >>> from jaxcam import sweeps
        >>> section = sweeps.Map(lambda x, p: x / 2)
        >>> samples = section.sample(np.ones((1, 1)), turns=6, keep=4)
        >>> sweeps.return_times(samples).tolist()
        [[1.0, 1.0, 1.0]]
    """
    return np.diff(samples.times, axis=1)
