"""Restitution laws from the impacts at each gap of a system."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ..fitting import restitution_laws, RestitutionFit
from ..hybrid import HybridSystem
from ..recordings import RecordingError, Segments
from ..recordings.cut import Impacts


def impact_laws(
    segments: Sequence[Segments], system: HybridSystem
) -> dict[str, RestitutionFit]:
    """Fit restitution laws for each gap that has enough impacts.

    Returns:
        The laws from `restitution_laws`; if there are several gaps, the names begin
            with the name of the constraint.
    """
    sides = np.unique(np.concatenate([part.impacts.side for part in segments]))
    found = {}
    for side in sides:
        there = [_on(part, int(side)) for part in segments]
        before = f"{system.constraint_name(int(side))}, " if len(sides) > 1 else ""
        try:
            laws = restitution_laws(there)
        except RecordingError:
            # too few impacts for a law, but the motion can still be fitted
            continue
        found |= {f"{before}{name}": law for name, law in laws.items()}
    return found


def _on(part: Segments, side: int) -> Segments:
    """Return a recording that retains only the impacts at one gap."""
    keep = part.impacts.side == side
    columns = {
        field.name: getattr(part.impacts, field.name)[keep]
        for field in dataclasses.fields(Impacts)
    }
    return dataclasses.replace(part, impacts=Impacts(**columns))
