"""The impact section, with a point at every impact."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ...hybrid import HybridSystem, Settings
from ...hybrid.batch import loop_state
from ...hybrid.codes import RowKind
from ...parameters import pick
from ._hybrid_lanes import Rows, run_tables
from ._samples import Samples
from ._system_section import AbstractSystemSection


class ImpactSection(AbstractSystemSection):
    """Impact section: the state just after each impact, and the time of the impact.

    A chatter sequence is listed up to the impact after which it is completed
    analytically; set `Settings(chatter_depth=...)` to list more.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from jaxcam.sweeps import ImpactSection
        >>> ImpactSection(ImpactOscillator()).regular
        False
    """

    system: HybridSystem
    """As for [`jaxcam.sweeps.Stroboscopic`][]."""
    t0: float = 0.0
    """Start time (s)."""
    period: float | None = None
    """As for [`jaxcam.sweeps.Stroboscopic`][]."""
    settings: Settings | None = None
    """Accuracy settings; by default, the tolerance is 1e-9 and chatter is listed down
    to a hundredth of the fastest rebound.
    """
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
        n = states.shape[1]
        settings = self.settings
        if settings is None:
            settings = Settings(tolerance=1e-9, chatter_depth=0.01)
        rows = Rows(_Row(keep), keep + 1, 2 + n, settings)
        numbers, impacts, code = run_tables(self, rows, states, turns, where, values)
        found, times, rests, final = _found(numbers, impacts, keep)
        return Samples(
            states=found,
            times=times,
            hits=np.isfinite(times).astype(int),
            rests=np.nan_to_num(rests).astype(int),
            final=final,
            contact=np.zeros(len(states), dtype=bool),
            code=code,
        )


class _Row(NamedTuple):
    """Stores the last `keep` impacts in a ring buffer, and the state at the last
    stop.
    """

    keep: int

    def __call__(self, record, lane):
        kind = record.kind
        hit = (kind == float(RowKind.IMPACT)) | (kind == float(RowKind.LAST_IMPACT))
        earlier = loop_state(lane).impacts - 1.0
        ring = earlier - self.keep * jnp.floor(earlier * (1 / self.keep) + 1e-9)
        last = jnp.where(kind == float(RowKind.STOP), float(self.keep), -1.0)
        return jnp.where(hit, ring, last), [kind, record.t, *record.after]


def _found(numbers, impacts, keep):
    """Return states, times and flags of completed chatter; and the last state."""
    # the latest impact is last; a buffer that is not full starts with NaN
    order = (impacts[:, None] + np.arange(keep)) % keep
    rows = np.take_along_axis(numbers, order[..., None], axis=1)
    rests = (rows[..., 0] == float(RowKind.LAST_IMPACT)).astype(float)
    return rows[..., 2:], rows[..., 1], rests, numbers[:, keep, 2:]
