"""Compile a module for this machine once, and store the code on disk."""

import ctypes
import functools
import hashlib
import itertools
import os
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

import jax
import llvmlite
import llvmlite.binding as llvm


# optimisation level; as in XLA, the order of operations is not changed
_LEVEL = 2


class Compiled:
    """A compiled function, which keeps its machine code in memory."""

    def __init__(self, tracker, name: str, result, arguments):
        self._tracker = tracker
        self._function = ctypes.CFUNCTYPE(result, *arguments)(tracker[name])

    def __call__(self, *arguments):
        return self._function(*arguments)


@functools.cache
def _target() -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple()


def _features() -> str:
    return llvm.get_host_cpu_features().flatten()


@functools.cache
def vector_width() -> int:
    """Return the number of 64-bit floats in a register of this machine."""
    features = llvm.get_host_cpu_features()
    if features.get("avx512f"):
        return 8
    return 4 if features.get("avx") else 2


def _machine():
    # in the small code model, constants are addressed relative to the code
    return _target().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=_features(),
        opt=_LEVEL,
        reloc="pic",
        codemodel="small",
    )


@functools.cache
def _linker():
    """Return the code loader; JITLink keeps a function and its constants together."""
    return llvm.create_lljit_compiler(_machine(), use_jit_link=True)


_NUMBERS = itertools.count()
_LOCK = threading.Lock()


def compiled(text: str, name: str, result, arguments) -> Compiled:
    """Compile the function `name` of a module of LLVM IR."""
    _target()
    key = _key(text)
    code = _stored(key)
    if code is None:
        code = _code_of(text)
        _store(key, code)
    library = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
    library.export_symbol(name)
    with _LOCK:
        tracker = library.link(_linker(), f"{name}.{next(_NUMBERS)}")
    return Compiled(tracker, name, result, arguments)


def _code_of(text: str) -> bytes:
    module, machine = llvm.parse_assembly(text), _machine()
    options = llvm.create_pipeline_tuning_options(speed_level=_LEVEL)
    # the code is already vectorised
    options.loop_vectorization = options.slp_vectorization = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


def _key(text: str) -> str:
    about = (
        llvmlite.__version__,
        llvm.llvm_version_info,
        llvm.get_default_triple(),
        llvm.get_host_cpu_name(),
        _features(),
        _LEVEL,
        text,
    )
    return hashlib.sha256(repr(about).encode()).hexdigest()


def user_cache() -> Path:
    """Return the cache folder of the user."""
    if sys.platform == "win32" and os.environ.get("LOCALAPPDATA"):
        return Path(os.environ["LOCALAPPDATA"])
    if sys.platform == "darwin":
        return Path("~/Library/Caches").expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()


def _folder() -> Path | None:
    """Return the folder of compiled code, inside JAX's cache folder if one is set."""
    given = jax.config.jax_compilation_cache_dir  # pyright: ignore
    try:
        folder = Path(given) if given else user_cache() / "jaxcam" / "compiled"
        folder = folder / "llvm"
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        return None
    return folder


def _stored(key: str) -> bytes | None:
    folder = _folder()
    if folder is None:
        return None
    try:
        content = (folder / key).read_bytes()
    except OSError:
        return None
    # a truncated or modified file is replaced
    mark, code = content[:32], content[32:]
    return code if hashlib.sha256(code).digest() == mark else None


def _store(key: str, code: bytes) -> None:
    folder = _folder()
    if folder is None:
        return
    try:
        with tempfile.NamedTemporaryFile(dir=folder, delete=False) as file:
            file.write(hashlib.sha256(code).digest() + code)
        os.replace(file.name, folder / key)
    except OSError:
        return
