"""Run blocks on an executor, and store each as it finishes."""

import abc
import os
import time
from collections.abc import Callable
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    FIRST_COMPLETED,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import nullcontext
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ._checksums import names_of
from ._disk import OnDisk
from ._store import Memory, Store, StoreLayout


Arrays = dict[str, np.ndarray]
# exception of Dask after a block has failed on several workers
_LOST = ("KilledWorker", "FutureCancelledError")


class Progress(NamedTuple):
    """Progress of a sweep, in blocks and seconds."""

    done: int
    """Number of finished blocks."""
    total: int
    """Number of blocks."""
    elapsed: float
    """Time since the start (s)."""
    remaining: float
    """Expected time until the end (s), NaN until the first block is finished."""


class AbstractJob(abc.ABC):
    """A sweep divided into blocks.

    A block depends only on the fields of the job and, if `chained` is set, on the
    previous block.
    """

    layout: StoreLayout
    """Arrays that the sweep stores."""
    chained: bool = False
    """Whether a block needs the result of the previous one."""

    @abc.abstractmethod
    def work(self, block: int, before: Arrays | None) -> Callable[[], Arrays]:
        """Return a block as a function that can be sent to another process and called
        there.

        Args:
            block: Index of the block.
            before: Result of the previous block, if `chained`.

        Returns:
            A function without arguments.
        """


def run_blocks(
    job: AbstractJob,
    *,
    out: str | Path | None = None,
    resume: bool = False,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Store:
    """Compute the missing blocks of a sweep and store each when it is finished.

    An interruption (Ctrl-C) loses only the blocks in progress.

    Args:
        job: The sweep.
        out: Folder for a Zarr group; by default, results are kept in memory.
        resume: Whether to continue from the blocks in the folder. Missing or damaged
            blocks are recomputed.
        executor: Any `concurrent.futures.Executor`; default: `workers` threads. Results
            do not depend on it.
        workers: Number of threads; default: one per core.
        progress: Called after each block with a [`jaxcam.sweeps.blocks.Progress`][].

    Returns:
        The store with the results.

    Raises:
        ValueError: The folder contains data other than this sweep.
        RuntimeError: Workers were lost.

    Examples:
        >>> from jaxcam.sweeps.blocks import AbstractJob, run_blocks
        >>> from jaxcam.sweeps.blocks import StoredVariable, StoreLayout
        >>> times = {"time": StoredVariable(("drop",), (), float)}
        >>> class Falls(AbstractJob):
        ...     heights = np.array([0.5, 1.0, 2.0])
        ...     layout = StoreLayout(3, 2, times, {}, {"sweep": "falls"})
        ...     def work(self, block, before):
        ...         part = self.heights[slice(*self.layout.bounds(block))]
        ...         return lambda: {"time": np.sqrt(2 * part / 9.81)}
        >>> store = run_blocks(Falls())
        >>> store.dataset()["time"].values.round(3).tolist()
        [0.319, 0.452, 0.639]
    """
    layout = job.layout
    store = Memory(layout) if out is None else OnDisk(out, layout, resume)
    if workers is not None and workers < 1:
        raise ValueError(f"workers is {workers}; give 1 or more")
    todo = [block for block, done in enumerate(store.finished()) if not done]
    report = _Report(progress, layout.blocks, len(todo))
    workers = (os.cpu_count() or 1) if workers is None else workers
    workers = 1 if job.chained else workers
    own = ThreadPoolExecutor(workers) if executor is None else nullcontext(executor)
    with own as pool:
        # enough blocks in progress that no worker has to wait for the next one, but not
        # many more
        width = 2 * (getattr(pool, "_max_workers", None) or _workers_of(pool))
        if job.chained:
            width = 1
        _drive(job, store, todo, pool, width, report)
    return store


def _drive(job, store, todo, pool, width, report) -> None:
    waiting, pending = iter(todo), {}
    try:
        while True:
            for block in waiting:
                before = store.read(block - 1) if job.chained and block else None
                pending[pool.submit(job.work(block, before))] = block
                if len(pending) >= width:
                    break
            if not pending:
                return
            done, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in done:
                _take(store, future, pending.pop(future), todo)
                report()
    finally:
        for future in pending:
            future.cancel()


def _take(store: Store, future: Future, block: int, todo) -> None:
    try:
        arrays = future.result()
    except Exception as error:
        lost = isinstance(error, BrokenExecutor) or type(error).__name__ in _LOST
        if not lost:
            raise
        done = store.finished()
        left = [b for b in todo if not done[b]]
        raise RuntimeError(
            f"a worker was lost; blocks {names_of(left)} are not finished: run the "
            "sweep again with resume=True to compute them"
        ) from error
    store.write(block, arrays)


def _workers_of(pool) -> int:
    """Return the number of workers of a Dask executor; for others, that of cores."""
    client = getattr(pool, "_client", None)
    if client is not None:
        return max(1, sum(client.nthreads().values()))
    return os.cpu_count() or 1


class _Report:
    def __init__(self, progress, total: int, todo: int):
        self._progress, self._total = progress, total
        self._skipped, self._done = total - todo, 0
        self._begin = time.monotonic()

    def __call__(self) -> None:
        self._done += 1
        if self._progress is None:
            return
        elapsed = time.monotonic() - self._begin
        left = self._total - self._skipped - self._done
        remaining = elapsed / self._done * left
        done = self._skipped + self._done
        self._progress(Progress(done, self._total, elapsed, remaining))
