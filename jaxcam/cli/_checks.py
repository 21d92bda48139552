"""Checks of option values shared by several commands."""

import math
from pathlib import Path


# maximum number of values kept by a sweep; at 8 bytes each, they fit into the memory of
# a laptop
_MOST = 2 * 10**8


def numbers(
    option: str, text: str, example: str, finite: bool = True
) -> tuple[float, ...]:
    """Parse numbers separated by commas. **Raises:** `ValueError`.

    **Arguments:** `finite`: whether to reject non-finite numbers; `False` if the system
    rejects them later, with a message of its own.
    """
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if not found or (finite and not all(map(math.isfinite, found))):
        raise ValueError(
            f"{option} is {text!r}; give numbers separated by commas, such as "
            f"{example}."
        )
    return found


def at_least(option: str, value: int | None, least: int) -> None:
    if value is not None and value < least:
        raise ValueError(f"{option} is {value}; give {least} or more.")


def check_finite(option: str, value: float | None) -> None:
    if value is not None and not math.isfinite(value):
        raise ValueError(f"{option} is {value:g}; give a finite number.")


def check_size(options: str, *counts: int) -> None:
    """Reject a sweep that would not fit into memory."""
    if math.prod(counts) > _MOST:
        raise ValueError(
            f"{options} request {' times '.join(f'{float(c):.6g}' for c in counts)} "
            f"values, more than {_MOST:.0e}; reduce them."
        )


def check_resume(resume: bool, out: Path | None) -> None:
    if resume and out is None:
        raise ValueError(
            "--resume needs the folder of the interrupted command: --out DIR."
        )
