"""The stroboscopic section, with one point per forcing period."""

import equinox as eqx
import numpy as np

from ...hybrid import HybridSystem, Settings, stroboscope
from ._hybrid_lanes import chunk_rows, run_lanes, smallest_gaps
from ._samples import Samples
from ._system_section import AbstractSystemSection


class Stroboscopic(AbstractSystemSection):
    """Stroboscopic section: states at t0 + k period, k = 1, 2, ...

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from jaxcam.sweeps import Stroboscopic
        >>> Stroboscopic(ImpactOscillator()).regular
        True
    """

    system: HybridSystem
    """A [`jaxcam.hybrid.HybridSystem`][]."""
    t0: float = 0.0
    """Start time (s), which determines the phase of the samples."""
    period: float | None = None
    """Sampling period (s); default: the forcing period of the system."""
    settings: Settings | None = None
    """Accuracy settings; by default, the tolerance is 1e-9 and chatter is completed as
    soon as the theory allows.
    """
    lanes: int = eqx.field(default=128, static=True)
    """Number of motions advanced together in one compiled program."""
    max_steps: int = eqx.field(default=1_000_000, static=True)
    """Maximum number of attempted steps per motion in one call."""
    regular: bool = eqx.field(default=True, static=True, init=False)
    """Samples are one period apart."""
    impacting: bool = eqx.field(default=True, static=True, init=False)
    """Impacts are counted."""

    def sample(self, states, turns, keep, *, where=None, values=None) -> Samples:
        states = np.asarray(states, dtype=float)
        n = states.shape[1]

        def run(states, values, width):
            made = stroboscope(
                self.system,
                states,
                turns,
                skip=turns - keep,
                t0=self.t0,
                where=where,
                values=values,
                period=self.period,
                settings=self.settings,
                block=width,
                rows=chunk_rows(width),
                max_steps=self.max_steps,
            )
            return made.states, made.hits, made.rests, made.code

        lanes = (self.system, self.t0, states, where, values, self.lanes)
        tails = ((keep, n), (keep,), (keep,))
        samples, hits, rests, code = run_lanes(run, *lanes, tails)
        hits, rests = np.nan_to_num(hits).astype(int), np.nan_to_num(rests).astype(int)
        return Samples(
            states=samples,
            times=self._times(turns, keep, where, values, len(states)),
            hits=hits,
            rests=rests,
            final=samples[:, -1],
            contact=self._touching(samples, hits, code, where, values),
            code=code,
        )

    def _touching(self, samples, hits, code, where, values):
        """Return whether a motion ends in contact without any impact."""
        calm = (code == 0) & (hits.sum(axis=1) == 0)
        if not np.any(calm):
            return calm
        ends = np.where(calm[:, None], samples[:, -1], samples[calm][0, -1])
        gap = smallest_gaps(self.system, self.t0, ends, where, values, room=-1e3)
        return calm & (gap <= 0)

    def _times(self, turns, keep, where, values, lanes):
        turn = np.arange(turns - keep + 1, turns + 1, dtype=float)
        length = self.turn(where, values)
        return np.broadcast_to(self.t0 + turn * length[:, None], (lanes, keep))
