"""Sample any Poincaré section."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ...hybrid import HybridSystem, Settings
from ...hybrid.codes import RowKind
from ...hybrid.sections import with_section
from ...parameters import pick
from ._hybrid_lanes import Rows, run_tables
from ._samples import Samples
from ._system_section import AbstractSystemSection


class PoincareSection(AbstractSystemSection):
    """Poincaré section: crossings of `function(t, state) = 0`, with their times.

    A jump of the state across the section at an impact is not a crossing, nor is the
    end of a contact that held the motion on the section. For points at a constraint,
    use [`jaxcam.sweeps.ImpactSection`][].

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from jaxcam.sweeps import PoincareSection
        >>> PoincareSection(ImpactOscillator(), lambda t, state: state[1]).direction
        1
    """

    system: HybridSystem
    """As for [`jaxcam.sweeps.Stroboscopic`][]."""
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
    lanes: int = eqx.field(default=128, static=True)
    """As for [`jaxcam.sweeps.Stroboscopic`][]."""
    max_steps: int = eqx.field(default=1_000_000, static=True)
    """As for [`jaxcam.sweeps.Stroboscopic`][]."""
    regular: bool = eqx.field(default=False, static=True, init=False)
    """Samples are not one period apart."""
    impacting: bool = eqx.field(default=True, static=True, init=False)
    """Impacts are counted."""

    def sample(self, states, turns, keep, *, where=None, values=None) -> Samples:
        states = np.asarray(states, dtype=float)
        where = None if where is None else pick(where, self.system)
        lanes, n = states.shape
        if self.direction not in (-1, 0, 1):
            raise ValueError(
                f"direction is {self.direction}; choose 1 for rising crossings, -1 for "
                "falling ones, or 0 for both"
            )
        whole = with_section(self.system, self.function, self.direction, n)
        inner = None if where is None else lambda s: where(s.system)
        settings = Settings() if self.settings is None else self.settings
        # store one point more than requested, because the events before each point are
        # counted from the previous point
        rows = Rows(_Row(keep + 1), keep + 2, 4 + n, settings)
        parts = states, turns, where, values
        numbers, _, code = run_tables(self, rows, *parts, watched=(whole, inner))
        found = numbers[:, : keep + 1]
        order = np.argsort(
            np.nan_to_num(found[..., 0], nan=-1.0), axis=1, kind="stable"
        )
        found = np.take_along_axis(found, order[..., None], axis=1)
        counts = np.diff(np.nan_to_num(found[..., 1:3]), axis=1)
        missing = np.isnan(found[:, 1:, 0])
        counts[missing] = 0.0
        return Samples(
            states=found[:, 1:, 4:],
            times=found[:, 1:, 3],
            hits=counts[..., 0].astype(int),
            rests=counts[..., 1].astype(int),
            final=numbers[:, keep + 1, 4:],
            contact=np.zeros(lanes, dtype=bool),
            code=code,
        )


class _Row(NamedTuple):
    """Stores the last points in a ring buffer, and the state at the last stop.

    A row contains the number of the point, the impacts and completed chatters so far,
    the time and the state.
    """

    size: int

    def __call__(self, record, lane):
        (here,), (number,) = record.points, lane.points
        earlier = number - 1.0
        ring = earlier - self.size * jnp.floor(earlier * (1 / self.size) + 1e-9)
        last = jnp.where(record.kind == float(RowKind.STOP), float(self.size), -1.0)
        counts = [number, lane.impacts, lane.chatters]
        return jnp.where(here, ring, last), [*counts, record.t, *record.after]


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
