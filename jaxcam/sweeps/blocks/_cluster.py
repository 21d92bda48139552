"""Use Dask as an executor for sweeps too large for one machine."""

import os
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager


@contextmanager
def cluster(address: str, workers: int | None = None) -> Iterator[Executor]:
    """Return a context with an executor on a Dask cluster, to be passed as `executor`.

    ```python
    with jaxcam.sweeps.cluster("local", workers=2) as executor:
        jaxcam.sweeps.basins(system, grid, 100, executor=executor)
    ```

    A lost worker is replaced, and its blocks are computed again.
    [Sweeps](../sweeps.md#long-computations) compares the ways to compute blocks. A
    script that calls this function must be guarded by `if __name__ == "__main__":`.

    Args:
        address: "local" for single-threaded processes on this machine, which end with
            the context; or "tcp://host:port" of a running scheduler.
        workers: Number of local processes; default: one per core.

    Returns:
        A context manager that yields the executor.

    Raises:
        ValueError: The address is invalid, the scheduler cannot be reached, or Dask is
            not installed.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise ValueError(
            "a cluster needs Dask; install it with: pip install 'jaxcam[cluster]'"
        ) from None
    if address != "local" and "://" not in address:
        raise ValueError(
            f'cluster is {address!r}; choose "local", or the address of a scheduler, '
            "such as tcp://127.0.0.1:8786"
        )
    if address == "local":
        made = LocalCluster(
            n_workers=workers or os.cpu_count() or 1,
            threads_per_worker=1,
            dashboard_address=None,  # pyright: ignore
        )
    else:
        made = None
    try:
        try:
            client = Client(address if made is None else made, timeout="10s")
        except (OSError, TimeoutError):
            raise ValueError(
                f"cannot connect to {address}; start a scheduler there, or choose "
                '"local"'
            ) from None
        try:
            yield client.get_executor(pure=False)
        finally:
            client.close()
    finally:
        if made is not None:
            made.close()
