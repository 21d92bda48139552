"""Opt-in compiler options that turn a batched event loop into one kernel."""

import os

from jax._src import xla_bridge


_OPTIONS = (
    "--xla_backend_extra_options="
    "xla_cpu_small_while_loop_byte_threshold=1000000000,"
    "xla_cpu_use_multi_output_fusion=true "
    "--xla_cpu_prefer_vector_width=512"
)
_state = {"one_kernel": False}


def tune_compiler() -> None:
    """Ask XLA to compile each batched event loop as a single kernel, on the CPU.

    Call it once, before JAX makes its first array. Batches then run about twice as
    fast. The options are not documented by XLA and may vanish; results do not depend on
    them. Without this call nothing changes.

    **Raises:** `RuntimeError` once JAX has started its backend, since it reads the
    options only then.
    """
    if _started():
        raise RuntimeError(
            "JAX has already made an array, and reads compiler options only before; "
            "call jaxcam.hybrid.tune_compiler() right after the imports"
        )
    flags = os.environ.get("XLA_FLAGS", "")
    if _OPTIONS not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {_OPTIONS}".strip()
    _state["one_kernel"] = True


def one_kernel() -> bool:
    """Whether loops are compiled as single kernels, and need no values kept."""
    return _state["one_kernel"]


def _started() -> bool:
    return xla_bridge.backends_are_initialized()
