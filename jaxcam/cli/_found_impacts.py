"""Say how many impacts and contacts were found in the recordings of a rig."""

from collections.abc import Sequence

from ..hybrid import HybridSystem
from ..recordings import Segments
from ..tables import counted


def found_impacts(segments: Sequence[Segments], system: HybridSystem) -> str:
    """Return a sentence with the numbers of impacts and contacts, and the recordings
    that have neither; empty if there is none at all.
    """
    impacts = sum(part.impacts.count for part in segments)
    contacts = sum(len(part.contacts) for part in segments)
    if not impacts + contacts:
        return ""
    sides = [int(side) for part in segments for side in part.impacts.side]
    names = [
        f"{system.constraint_name(side)}: {counted(sides.count(side), 'impact')}"
        for side in sorted(set(sides))
    ]
    where = f" ({', '.join(names)})" if len(names) > 1 else ""
    silent = [
        part.recording.name
        for part in segments
        if not part.impacts.count and not part.contacts
    ]
    none = f", but none in {' and '.join(silent)}" if silent else ""
    longer = f" and {counted(contacts, 'longer contact')}" if contacts else ""
    found = f"{counted(impacts, 'impact')}{where}{longer}"
    return f"Found in the recordings: {found}{none}."
