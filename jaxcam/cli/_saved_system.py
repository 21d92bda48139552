"""Save and load systems, including those defined in a user's Python file."""

import json
from pathlib import Path
from typing import Any

from ..hybrid import HybridSystem


# source of a user's saved system: FILE.py:CLASS
_SOURCE = "source"


def as_saved(system: HybridSystem, about: dict[str, Any]) -> dict[str, Any]:
    """Return a system as JSON, with the name of its source file if that is outside the
    package.

    If a system cannot be saved, only `about` and the reason (`not_saved`) are returned.
    """
    from ..discrepancy.terms import WithTerms
    from ..fitting.own_systems import system_source
    from ..models.saved import system_to_json

    try:
        found = system_to_json(system, about=about)
    except ValueError as error:
        return {"not_saved": f"The system is not saved: {error}", "about": about}
    base = system.base if isinstance(system, WithTerms) else system
    source = system_source(type(base))
    return found if source is None else {**found, _SOURCE: source}


def load_saved(file: Path) -> HybridSystem:
    """Load the system in a file written by `jaxcam fit` or `jaxcam diagnose`.

    The Python file that defines a user's system is executed.

    Raises:
        ValueError: The file is invalid; the message gives the reason.
    """
    from ..discrepancy.terms import saved_classes
    from ..fitting.own_systems import classes_beside, split_name, system_class
    from ..models import load_system

    classes, source = saved_classes(), _source_of(file)
    if source is not None:
        python = Path(split_name(source)[0])
        if not python.is_file():
            raise ValueError(
                f"{file}: its system is in {python}, which does not exist; restore "
                f"it, or correct `{_SOURCE}`."
            )
        classes = (*classes, *classes_beside(system_class(source)))
    return load_system(file, classes=classes)


def _source_of(file: Path) -> str | None:
    try:
        found = json.loads(file.read_text("utf-8"))
    except (ValueError, RecursionError):
        # the function that reads the complete file reports such errors
        return None
    source = found.get(_SOURCE) if isinstance(found, dict) else None
    return source if isinstance(source, str) else None
