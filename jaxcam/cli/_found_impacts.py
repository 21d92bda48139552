"""Say how many impacts and contacts were found in the recordings of a rig."""

from collections.abc import Sequence

from ..discrepancy.report import listed
from ..hybrid import HybridSystem
from ..recordings import Segments
from ..tables import counted


def found_impacts(segments: Sequence[Segments], system: HybridSystem) -> str:
    """Return a sentence with the numbers of impacts and contacts, and the recordings
    that have neither; empty if there is none at all.
    """
    impacts = sum(part.impacts.count for part in segments)
    contacts = sum(len(part.contacts) for part in segments)
    sides = [int(side) for part in segments for side in part.impacts.side]
    named = [
        f"{sides.count(side)} with {system.constraint_name(side)}"
        for side in sorted(set(sides) | set(range(len(system.constraint_names))))
    ]
    parts = []
    if impacts:
        where = f" ({listed(named)})" if len(named) > 1 else ""
        parts.append(f"{counted(impacts, 'impact')}{where}")
    if contacts:
        parts.append(counted(contacts, "longer contact"))
    if not parts:
        return ""
    silent = [
        part.recording.name
        for part in segments
        if not part.impacts.count and not part.contacts
    ]
    none = f", but nothing in {listed(silent)}" if silent else ""
    return f"Found in the recordings: {' and '.join(parts)}{none}."
