"""Run work in a separate process, in parallel with the command."""

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar


T = TypeVar("T")


@contextmanager
def beside(
    work: Callable[[Path], T], folder: Path | None
) -> Iterator[Callable[[], T | None]]:
    """Start `work(folder)` in another process, and yield a function that waits for its
    result.

    If `folder` is `None`, nothing is started, and the result is `None`.
    """
    if folder is None:
        yield lambda: None
        return
    # a fork is unsafe, because the threads of the compiler are already running
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        running = pool.submit(work, folder)
        try:
            yield running.result
        except BaseException:
            running.cancel()
            for process in pool._processes.values():  # pyright: ignore
                process.terminate()
            raise
