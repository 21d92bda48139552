"""Lock an output folder, so that one command at a time writes to it."""

import os
from pathlib import Path


_held: list[int] = []


def hold(folder: Path) -> None:
    """Lock a folder until `release` or the end of the process.

    The operating system holds the lock, so a killed command leaves no stale lock. On
    systems without such locks (Windows, some network file systems) the folder stays
    unlocked.

    Raises:
        ValueError: Another command holds the lock.
    """
    try:
        import fcntl
    except ImportError:
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise ValueError(
            f"{folder}: another jaxcam process is writing to this folder; wait "
            f"for it to finish, or choose another folder with --out."
        ) from None
    except OSError:
        os.close(handle)
        return
    _held.append(handle)


def release() -> None:
    """Release all locks of this process."""
    while _held:
        os.close(_held.pop())
