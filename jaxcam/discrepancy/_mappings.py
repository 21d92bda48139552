"""Limit the number of memory mappings used by compiled programs."""

from pathlib import Path

from ..hybrid import clear_caches


# Maximum number of mappings observed in one diagnosis
_NEEDED = 30_000
_USED, _LIMIT = Path("/proc/self/maps"), Path("/proc/sys/vm/max_map_count")


def make_room(used: Path = _USED, limit: Path = _LIMIT) -> bool:
    """Discard the compiled programs if another diagnosis might exceed the limit on
    memory mappings.

    Each program uses some of the memory mappings that Linux allows per process; beyond
    the limit, the compiler fails with "Cannot allocate memory". On other operating
    systems, this function does nothing.

    **Returns:** whether the programs were discarded.
    """
    try:
        most = int(limit.read_text())
        with used.open("rb") as lines:
            now = sum(1 for _ in lines)
    except (OSError, ValueError):
        return False
    if now + _NEEDED < most:
        return False
    clear_caches()
    return True
