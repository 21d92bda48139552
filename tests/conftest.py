"""What every test runs under: strict arrays, no windows, a shared compilation cache."""

import gc
import os
import pkgutil
import tempfile
from pathlib import Path

import jax
import jaxtyping
import matplotlib
import pytest
from hypothesis import settings


# functions of these packages are called for every operation of a traced program;
# checking their types would double the time of the tests
_UNCHECKED = {"jaxcam.hybrid.backend", "jaxcam.hybrid.lowering"}


def _checked(name: str) -> list[str]:
    """The package, or its parts except the unchecked ones."""
    if not any(other.startswith(f"{name}.") for other in _UNCHECKED):
        return [name] if name not in _UNCHECKED else []
    folder = Path(__file__).parents[1].joinpath(*name.split("."))
    inside = [module.name for module in pkgutil.iter_modules([str(folder)])]
    assert inside, folder
    return [part for one in inside for part in _checked(f"{name}.{one}")]


# types and shapes are checked as functions are called; before any of ours is imported.
# As Python's type system has it, an integer is a float
jaxtyping.install_import_hook(
    ["continuation", "variational", *_checked("jaxcam")],
    "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))",
)

import jaxcam  # noqa: F401  64-bit floats, and everything it does on import is allowed


jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")
matplotlib.use("Agg")

# compiling takes longer than any deadline; a run elsewhere must be repeatable
settings.register_profile("jaxcam", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "jaxcam")


def _cache_folder() -> Path:
    """A folder of the user's, or a temporary one where there is no home."""
    root = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    try:
        folder = Path(root).expanduser() / "jaxcam" / "tests"
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        folder = Path(tempfile.mkdtemp(prefix="jaxcam-tests-"))
    return folder


# tracing creates many objects, nearly all of which are kept: searching them for garbage
# takes a sixth of the time
gc.freeze()
gc.set_threshold(50_000, 20, 50)

_CACHE = str(_cache_folder())
jax.config.update("jax_compilation_cache_dir", _CACHE)
# also for the commands, which would set the user's folder, and for their processes
os.environ["JAX_COMPILATION_CACHE_DIR"] = _CACHE
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)


@pytest.fixture
def unchecked_types():
    """What a user sees who passes something of the wrong type: nothing checks it."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


# Linux gives a process 65530 memory mappings, and a large compiled program takes
# dozens: a process that runs out of them ends in a segmentation fault
_MAPPINGS = 40_000


@pytest.fixture(autouse=True, scope="module")
def programs_are_given_back():
    yield
    mappings = Path("/proc/self/maps")
    if mappings.exists() and len(mappings.read_text().splitlines()) > _MAPPINGS:
        jaxcam.clear_caches()
