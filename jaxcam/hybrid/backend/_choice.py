"""Run something by LLVM where that is possible."""

from collections.abc import Callable
from typing import Any, TypeVar

from ..programs import is_outermost, is_traced
from ._attempts import say_lacking
from ._writer import Lacking


T = TypeVar("T")


def runs_by_llvm(settings, values: Any, run: Callable[[], T]) -> T | None:
    """Return the result of `run`, which needs the LLVM backend; None if the settings or
    a transformation exclude it, or if it lacks an operation.

    **Arguments:** `values` are the numbers on which `run` depends.

    **Raises:** `ValueError` if the settings demand LLVM and it lacks an operation.
    """
    if not settings.compiles or not is_outermost() or is_traced(values):
        return None
    try:
        return run()
    except Lacking as lacking:
        say_lacking(lacking, settings.demands)
        return None
