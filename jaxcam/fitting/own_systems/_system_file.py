"""Load systems from Python files: `two_stops.py:TwoStops`."""

import difflib
import hashlib
import inspect
import sys
import traceback
from pathlib import Path
from types import ModuleType

import equinox as eqx

from ...hybrid import HybridSystem
from ...hybrid.checks import missing_method
from ...recordings import RigError
from ...recordings.files import printable


# maximum number of characters quoted from the message of another error
_MOST = 200
# programs are compiled for each class, so an unchanged file must not create new classes
_loaded: dict[Path, tuple[bytes, ModuleType]] = {}


def system_class(named: str, folder: str | Path = ".") -> type[HybridSystem]:
    """Return the class of a system in a Python file; the file is executed.

    Args:
        named: `FILE.py:CLASS`, with the file relative to `folder`.
        folder: The folder.

    Returns:
        The class.

    Raises:
        RigError: The class cannot be loaded; the message gives the file and a fix.

    Examples:
        >>> from jaxcam.data import NEW_RIG
        >>> from jaxcam.fitting.own_systems import system_class
        >>> system_class("cart.py:Cart", NEW_RIG)().constraint_names
        ('left stop', 'right stop')
    """
    path, name = split_name(named)
    file = Path(folder) / path
    module = _module(file)
    found = _systems(module)
    if not name:
        some = next(iter(found), "CLASS")
        raise RigError(
            f"{file}: name the class that is the system, as in {file.name}:{some}."
        )
    cls = getattr(module, name, None)
    if cls is None:
        near = difflib.get_close_matches(name, found, n=1)
        hint = f"is `{near[0]}` meant?" if near else _there(found)
        raise RigError(f"{file}: there is no class `{name}` in it; {hint}")
    if not inspect.isclass(cls) or not issubclass(cls, HybridSystem):
        raise RigError(
            f"{file}: `{name}` is not a HybridSystem; derive it from "
            "jaxcam.HybridSystem."
        )
    missing = missing_method(cls)
    if missing is not None:
        raise RigError(f"{file}: `{name}` has no `{missing}`; add that method.")
    return cls


def system_source(cls: type[HybridSystem]) -> str | None:
    """Return `FILE.py:CLASS` for a class loaded by `system_class`, or `None` for any
    other class.

    Args:
        cls: The class.

    Returns:
        File and class as text, or `None`.

    Examples:
        >>> from jaxcam.data import NEW_RIG
        >>> from jaxcam.fitting.own_systems import system_class, system_source
        >>> cart = system_class("cart.py:Cart", NEW_RIG)
        >>> system_source(cart).endswith("cart.py:Cart")
        True
        >>> system_source(jaxcam.models.BouncingBall) is None
        True
    """
    for file, (_, module) in _loaded.items():
        if getattr(module, cls.__name__, None) is cls:
            return f"{file}:{cls.__name__}"
    return None


def classes_beside(cls: type[HybridSystem]) -> tuple[type, ...]:
    """Return the classes in the file of a system, for `load_system`."""
    there = vars(sys.modules[cls.__module__]).values()
    return tuple(
        one for one in there if inspect.isclass(one) and issubclass(one, eqx.Module)
    )


def split_name(named: str) -> tuple[str, str]:
    """Split `FILE.py:CLASS` into file and class; the class may be missing."""
    path, colon, name = named.rpartition(":")
    # the colon after a drive letter, as in C:\rigs\cart.py, is not followed by a class
    return (path, name) if colon and name.isidentifier() else (named, "")


def fault(error: BaseException, file: Path | None = None) -> str:
    """Describe an error raised by a user's code, with the line of the file."""
    lines = [
        frame.lineno
        for frame in traceback.extract_tb(error.__traceback__)
        if file is not None and Path(frame.filename) == file
    ]
    where = f"line {lines[-1]} raises " if lines and lines[-1] else ""
    if isinstance(error, SyntaxError):
        where = f"line {error.lineno} is not valid Python: "
    words = " ".join(str(error).split())
    words = words if len(words) <= _MOST else f"{words[:_MOST]}..."
    said = f"{type(error).__name__}: {words}" if words else type(error).__name__
    return printable(f"{where}{said}").rstrip(".")


def _module(file: Path) -> ModuleType:
    """Return the module of a file, which is executed again only if it changes."""
    if file.suffix != ".py":
        raise RigError(f"{file}: name a Python file and a class, as in cart.py:Cart.")
    if not file.is_file():
        raise RigError(f"{file}: there is no such file; give the path of a .py file.")
    file = file.resolve()
    content = file.read_bytes()
    known = _loaded.get(file)
    if known is not None and known[0] == content:
        return known[1]
    mark = hashlib.sha256(str(file).encode()).hexdigest()[:8]
    name = f"jaxcam_system_{file.stem}_{mark}"
    module = ModuleType(name)
    module.__file__ = str(file)
    sys.modules[name] = module
    # the file can import modules that are next to it
    sys.path.insert(0, str(file.parent))
    try:
        # compiled here, because Python's import cache compares modification times only
        # in whole seconds
        exec(compile(content, str(file), "exec"), vars(module))
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise RigError(f"{file}: {fault(error, file)}; correct it.") from error
    finally:
        sys.path.remove(str(file.parent))
    _loaded[file] = content, module
    return module


def _systems(module: ModuleType) -> list[str]:
    """Return the names of the systems defined in a file."""
    return [
        name
        for name, one in vars(module).items()
        if inspect.isclass(one)
        and issubclass(one, HybridSystem)
        and one.__module__ == module.__name__
    ]


def _there(found: list[str]) -> str:
    if not found:
        return "derive one from jaxcam.HybridSystem."
    return f"its systems are {', '.join(found)}."
