"""Print a result as a short table, as text and as HTML."""

import abc

import equinox as eqx
import numpy as np

from ...tables import ShortTable
from ..programs import is_traced


class Printed(eqx.Module):
    """A result that prints as a short table instead of its arrays.

    Traced values, and batches created by `vmap`, are printed as Equinox modules.
    """

    @abc.abstractmethod
    def _table(self) -> ShortTable:
        """Return the table; called only if all values are known."""

    def _batched(self) -> bool:
        """Return whether this is a batch of results."""
        return False

    def __str__(self) -> str:
        known = not (is_traced(self) or self._batched())
        return self._table().text() if known else repr(self)

    def _repr_html_(self) -> str | None:
        known = not (is_traced(self) or self._batched())
        return self._table().html() if known else None


def vector_text(vector) -> str:
    """Return the components of a state on one line; a long state is shortened."""
    shown = [f"{float(x):.6g}" for x in vector[:6]]
    return ", ".join([*shown, "…"] if len(vector) > 6 else shown)


def numbers(array, count) -> np.ndarray:
    """Return the valid entries of a padded array."""
    return np.asarray(array)[: int(count)]
