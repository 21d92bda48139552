"""A folder that is written to by one command at a time."""

import os
from pathlib import Path


_held: list[int] = []


def hold(folder: Path) -> None:
    """Keep other commands out of a folder until `release`, or the end of the process.

    The lock is the kernel's, so that a command that is killed leaves none behind. Where
    there is no such thing (Windows, some network file systems) nothing is kept out.

    Raises:
        ValueError: Where another command holds it.
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
            f"{folder}: another jaxcam is writing to this folder; wait until it is "
            f"done, or give --out another one."
        ) from None
    except OSError:
        os.close(handle)
        return
    _held.append(handle)


def release() -> None:
    """Let go of everything that this process holds."""
    while _held:
        os.close(_held.pop())
