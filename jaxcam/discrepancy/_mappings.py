"""Room for compiled programs: a process may have only so many memory mappings."""

from pathlib import Path

import jax


# What one diagnosis takes at most, as far as was seen
_NEEDED = 30_000
_USED, _LIMIT = Path("/proc/self/maps"), Path("/proc/sys/vm/max_map_count")


def make_room(used: Path = _USED, limit: Path = _LIMIT) -> bool:
    """Drop compiled programs where there is no room for those of one more diagnosis.

    Each of them takes some of the memory mappings that Linux allows a process; beyond
    the limit the compiler fails with "Cannot allocate memory". On other systems nothing
    is done.

    **Returns:** whether programs were dropped.
    """
    try:
        most = int(limit.read_text())
        with used.open("rb") as lines:
            now = sum(1 for _ in lines)
    except (OSError, ValueError):
        return False
    if now + _NEEDED < most:
        return False
    jax.clear_caches()
    return True
