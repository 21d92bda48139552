"""Compiling a module for this machine, once; the code is kept on disk."""

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


# as XLA: no change of the order of operations
_LEVEL = 2


class Compiled:
    """A function of the machine; it keeps its code alive."""

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
    """How many 64-bit floats a register of this machine holds."""
    features = llvm.get_host_cpu_features()
    if features.get("avx512f"):
        return 8
    return 4 if features.get("avx") else 2


def _machine():
    # small: constants are operands, found by their distance from the code
    return _target().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=_features(),
        opt=_LEVEL,
        reloc="pic",
        codemodel="small",
    )


@functools.cache
def _linker():
    """What loads code; JITLink keeps a function and its constants together."""
    return llvm.create_lljit_compiler(_machine(), use_jit_link=True)


_NUMBERS = itertools.count()
_LOCK = threading.Lock()


def compiled(text: str, name: str, result, arguments) -> Compiled:
    """The function `name` of a module in LLVM's language."""
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
    # it is written as vectors already
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
    """The folder in which this user's programs keep what can be made again."""
    if sys.platform == "win32" and os.environ.get("LOCALAPPDATA"):
        return Path(os.environ["LOCALAPPDATA"])
    if sys.platform == "darwin":
        return Path("~/Library/Caches").expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()


def _folder() -> Path | None:
    """Where compiled code is kept: with that of XLA if it has a place."""
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
    # a file that was cut off, or changed, is made again
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
