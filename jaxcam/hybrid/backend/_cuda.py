"""Run the loop of attempts on an NVIDIA GPU, with one thread for each batch element."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..caches import Cache
from ._attempts import Key, sizes_of, traced
from ._kernel import COUNTERS, ENTRY, module_of, UNFINISHED
from ._ptx import needed, ptx_of
from ._writer import compiled_or_lacking, Lacking


# number of threads in a block; small, because each thread needs many registers
_BLOCK = 64
# maximum number of rounds of attempts per launch; between launches, Python can be
# interrupted
_PATIENCE = 20_000


class CudaAttempts:
    """The compiled loop of attempts for one key, for the current GPU.

    **Raises:** `ValueError` if there is no GPU or no CuPy; `Lacking` if the program
    needs an operation that the backend does not have.
    """

    def __init__(self, key: Key):
        cupy = _cupy()
        program = traced(key)
        self.sizes = sizes_of(program)
        text = str(module_of(program, 1, threads=True))
        libdevice = _libdevice() if needed(text) else None
        capability = cupy.cuda.Device().compute_capability
        code = ptx_of(text, f"sm_{capability}", libdevice)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "attempts.ptx"
            path.write_text(code)
            self.kernel = cupy.RawModule(path=str(path)).get_function(ENTRY)

    def run(
        self,
        shared: np.ndarray,
        own: np.ndarray,
        lanes: np.ndarray,
        table: np.ndarray,
        *,
        first: float = 0.0,
        limit: float,
        between: Callable[[], None] | None = None,
    ) -> None:
        """Run batch elements to the end, or to `limit` attempts each.

        The arguments are those of `Attempts.run`.
        """
        cupy = _cupy()
        # each Python thread must select the GPU before it queries the kernel
        cupy.cuda.Device().use()
        states, log = cupy.asarray(lanes), cupy.asarray(table)
        blocks = min(-(-len(lanes) // _BLOCK), self._resident())
        threads = blocks * _BLOCK
        columns = self.sizes.state + self.sizes.own
        counters = cupy.zeros(len(COUNTERS), dtype=np.int64)
        arguments = (
            cupy.asarray(shared),
            cupy.asarray(own),
            states,
            cupy.zeros((columns, threads)),
            cupy.full(threads, -1, dtype=np.int64),
            cupy.arange(len(lanes), dtype=np.int64),
            counters,
            log,
            np.int64(len(lanes)),
            np.int64(table.shape[1]),
            np.float64(first),
            np.float64(limit),
            np.int64(_PATIENCE),
        )
        while True:
            counters[UNFINISHED] = 0
            self.kernel((blocks,), (_BLOCK,), arguments)
            if not int(counters[UNFINISHED]):
                break
            if between is not None:
                between()
        lanes[...], table[...] = cupy.asnumpy(states), cupy.asnumpy(log)

    def _resident(self) -> int:
        """Return the number of blocks that the GPU can run at a time."""
        cupy = _cupy()
        each = cupy.cuda.driver.occupancyMaxActiveBlocksPerMultiprocessor(
            self.kernel.kernel.ptr, _BLOCK, 0
        )
        return max(1, each * cupy.cuda.Device().attributes["MultiProcessorCount"])


_KNOWN = Cache()


def cuda_attempts_of(key: Key) -> CudaAttempts:
    """Return the loop for a key; it is compiled only once.

    **Raises:** as `CudaAttempts`.
    """
    # a kernel belongs to the GPU for which it was loaded
    one = key, _cupy().cuda.Device().id
    return compiled_or_lacking(_KNOWN, one, lambda: CudaAttempts(key))


def _cupy() -> Any:
    try:
        import cupy  # pyright: ignore
    except ImportError as error:
        raise ValueError(
            'backend="cuda" needs CuPy, which is not installed; run pip install '
            '"jaxcam[cuda]", or choose backend="llvm"'
        ) from error
    if not cupy.cuda.is_available():
        raise ValueError(
            'backend="cuda" needs an NVIDIA GPU, and CuPy finds none; choose '
            'backend="llvm" to run on the CPU'
        )
    return cupy


def _libdevice() -> bytes:
    """Return the code of libdevice, NVIDIA's library of mathematical functions."""
    try:
        from cuda import pathfinder  # pyright: ignore

        return Path(pathfinder.find_bitcode_lib("device")).read_bytes()
    except Exception as error:
        raise Lacking(
            "mathematical functions on the GPU without libdevice (pip install "
            "nvidia-nvvm provides it)"
        ) from error
