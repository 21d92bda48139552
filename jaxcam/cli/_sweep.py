"""What `jaxcam diagram` and `jaxcam basins` have in common."""

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from ._errors import fail, STOPPED_EARLY


# numbers that a sweep keeps; a few of 8 bytes each fit into the memory of a laptop
_MOST = 2 * 10**8


def numbers(option: str, text: str, example: str) -> tuple[float, ...]:
    """Finite numbers with commas between them. **Raises:** `ValueError`."""
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = (math.nan,)
    if not all(map(math.isfinite, found)):
        raise ValueError(
            f"{option} is {text!r}; give numbers with commas between them, such as "
            f"{example}."
        )
    return found


def at_least(option: str, value: int | None, least: int) -> None:
    if value is not None and value < least:
        raise ValueError(f"{option} is {value}; give {least} or more.")


def check_size(options: str, *counts: int) -> None:
    """Refuse a sweep that would not fit into memory, before it is tried."""
    if math.prod(counts) > _MOST:
        raise ValueError(
            f"{options} are {' times '.join(f'{float(c):.6g}' for c in counts)} "
            f"numbers, more than {_MOST:.0e}; give fewer."
        )


def check_cluster(address: str | None) -> None:
    """Find a wrong address before the work begins."""
    if address is not None and address != "local" and "://" not in address:
        raise ValueError(
            f"--cluster is {address!r}; choose local, or the address of a scheduler, "
            "such as tcp://127.0.0.1:8786."
        )


@contextmanager
def running(address: str | None, workers: int | None) -> Iterator[dict]:
    """Options of a sweep that say where it runs: threads here, or a cluster."""
    try:
        if address is None:
            yield {"workers": workers}
            return
        import jax

        from ..sweeps import cluster

        # new processes find the programs that are compiled already
        folder = jax.config.jax_compilation_cache_dir  # pyright: ignore
        if folder:
            os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(folder))
        with cluster(address, workers) as executor:
            yield {"executor": executor}
    except RuntimeError as error:
        fail(str(error))
        raise typer.Exit(STOPPED_EARLY) from None


def show(report):
    """A callback that shows how far a sweep is, and how long it will still take."""

    def callback(at) -> None:
        words = f"{at.done} of {at.total} blocks"
        if at.done < at.total:
            words += f", {_duration(at.remaining)} to go"
        report(words, at.done / at.total)

    return callback


def _duration(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "?"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
