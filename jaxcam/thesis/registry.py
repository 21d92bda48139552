"""Find all targets from the file names in the chapters."""

import pkgutil
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ..models import CamFollower
from .target import SIZES, Target


if TYPE_CHECKING:
    import pandas as pd


_CHAPTERS = "chapter_"
_KINDS = ("table", "figure")


def _place(module: str) -> tuple[int, int, int]:
    """Return the sort key of a file such as `figure_5_11`: chapter, tables before
    figures, number.
    """
    kind, chapter, number = module.rpartition(".")[2].split("_")
    return int(chapter), _KINDS.index(kind), int(number)


def _discovered() -> dict[str, Target]:
    """Return the `TARGET` of each file `table_C_N.py` or `figure_C_N.py` in the
    chapters.
    """
    here = Path(__file__).parent
    modules = [
        f"{chapter.name}.{module.name}"
        for chapter in pkgutil.iter_modules([str(here)])
        if chapter.name.startswith(_CHAPTERS)
        for module in pkgutil.iter_modules([str(here / chapter.name)])
        if module.name.startswith(_KINDS)
    ]
    found = {}
    for module in sorted(modules, key=_place):
        kind, chapter, number = module.rpartition(".")[2].split("_")
        target = import_module(f".{module}", __package__).TARGET
        found[f"{kind}-{chapter}.{number}"] = target
    return found


TARGETS: dict[str, Target] = _discovered()
"""The targets by name, such as "table-5.2" or "figure-5.14"."""


def reproduce(
    name: str,
    system: CamFollower,
    size: str = SIZES[0],
    *,
    progress: Callable[[str, float | None], None] | None = None,
) -> "pd.DataFrame":
    """Compute the numbers of a table or figure of the thesis, and compare them with the
    printed values.

    Args:
        name: A key of [`jaxcam.thesis.TARGETS`][], such as "table-5.2".
        system: The rig, such as `jaxcam.models.preset("calibrated")`.
        size: "default", or "full" for diagrams and basins at the published resolution.
        progress: Called with a sentence and the completed fraction (or `None`).

    Returns:
        Columns quantity, printed, computed, unit, difference and relative (the
            difference divided by the magnitude of the printed value); speeds are in rpm
            and everything else in SI units. A computed value is NaN if the rig has no
            such quantity; a printed value is NaN if the thesis shows only a drawing.

    Raises:
        ValueError: The name or size is unknown.

    Examples:
        >>> from jaxcam.models import preset
        >>> from jaxcam.thesis import TARGETS, reproduce
        >>> "table-4.4" in TARGETS
        True
    """
    if name not in TARGETS:
        known = ", ".join(TARGETS)
        raise ValueError(f"There is no {name!r} to reproduce; choose one of {known}.")
    return TARGETS[name].table(system, size, progress=progress)
