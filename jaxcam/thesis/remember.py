"""Cache results, so that a figure reuses the computation of its table."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, TypeVar

import jax
import numpy as np


_T = TypeVar("_T")
_KEPT = 6


def remembered(function: Callable[..., _T]) -> Callable[..., _T]:
    """Cache the latest results of a function of a rig and hashable arguments.

    A sweep is computed once for its table and its figure. Rigs are distinguished by the
    values of their parameters.
    """
    kept: OrderedDict[Hashable, _T] = OrderedDict()

    @wraps(function)
    def wrapper(system: Any, *arguments: Hashable) -> _T:
        leaves, structure = jax.tree.flatten(system)
        values = tuple(np.asarray(leaf).tobytes() for leaf in leaves)
        key = (structure, values, arguments)
        if key not in kept:
            kept[key] = function(system, *arguments)
        kept.move_to_end(key)
        while len(kept) > _KEPT:
            kept.popitem(last=False)
        return kept[key]

    return wrapper
