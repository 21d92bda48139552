"""Execution options that `jaxcam diagram` and `jaxcam basins` share."""

import dataclasses
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from ..hybrid import HybridSystem
from ._checks import at_least
from ._errors import fail, STOPPED_EARLY
from ._options import Cluster, Workers


@dataclasses.dataclass(frozen=True)
class Execution:
    """Execution of a sweep: in local threads, or on a cluster."""

    workers: Workers = None
    cluster: Cluster = None

    def check(self) -> None:
        """Reject an invalid number or address before the work begins."""
        at_least("--workers", self.workers, 1)
        address = self.cluster
        if address is not None and address != "local" and "://" not in address:
            raise ValueError(
                f"--cluster is {address!r}; choose local, or the address of a "
                "scheduler, such as tcp://127.0.0.1:8786."
            )

    def check_system(self, system: HybridSystem) -> None:
        """Reject a system that worker processes cannot import.

        Raises:
            ValueError: Other processes could not import the system.
        """
        from ..discrepancy.terms import WithTerms
        from ..fitting.own_systems import system_source

        base = system.base if isinstance(system, WithTerms) else system
        if self.cluster is not None and system_source(type(base)) is not None:
            raise ValueError(
                f"--cluster: worker processes cannot load {type(base).__name__}, "
                "which is defined in your own file; leave --cluster out to run in "
                "local threads."
            )

    @contextmanager
    def running(self) -> Iterator[dict]:
        """Yield the keyword arguments that determine how a sweep is executed."""
        try:
            if self.cluster is None:
                yield {"workers": self.workers}
                return
            import jax

            from ..sweeps import cluster

            # let new processes find the compiled programs
            folder = jax.config.jax_compilation_cache_dir  # pyright: ignore
            if folder:
                os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(folder))
            with cluster(self.cluster, self.workers) as executor:
                yield {"executor": executor}
        except RuntimeError as error:
            fail(str(error))
            raise typer.Exit(STOPPED_EARLY) from None


def show(report):
    """Return a callback that shows the progress of a sweep and the remaining time."""

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
