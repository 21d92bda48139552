"""Keep compiled programs on disk, so that a second run starts immediately."""

import os
import warnings


def keep_compiled_programs() -> None:
    """Turn on JAX's compilation cache, in the user's cache folder.

    A folder named by `JAX_COMPILATION_CACHE_DIR` takes precedence. If no folder is
    writable, there is no cache, and everything is compiled again.
    """
    import jax

    from ..hybrid.backend import user_cache

    if not os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        try:
            folder = user_cache() / "jaxcam" / "compiled"
            folder.mkdir(parents=True, exist_ok=True)
        except (OSError, RuntimeError):
            return
        jax.config.update("jax_compilation_cache_dir", str(folder))
    # also keep small programs: there are many, and together they take seconds to
    # compile
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    # if the entry of a program cannot be read or written, the program is simply
    # compiled again
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation")
