"""Find parametric forms that almost represent a function which has none."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from ...fitting import Fit
from ..search import Free, Hidden, Missing


class CloseForm(NamedTuple):
    """A form that explains a little less than a function, and its relative error."""

    fit: Fit
    form: Free
    # relative rms error
    error: float

    @property
    def percent(self) -> float:
        return max(100 * self.error, 0.01)


def close_forms(
    missing: Missing, others: Sequence[Missing], explained: float, small: float
) -> dict[str, CloseForm]:
    """Return, by their slots, the forms closest to functions that have none.

    **Arguments:** the functions found; other fits, the best first; the cost that the
    functions explain; and the fraction of it that a form may leave.
    """
    found: dict[str, CloseForm] = {}
    for other in others:
        left = max(other.fit.cost - missing.fit.cost, 0.0) / explained
        same = [one.label for one in other.functions] == [
            one.label for one in missing.functions
        ]
        if not (same and other.names == missing.names and left < small):
            continue
        for one, form in zip(missing.functions, other.functions, strict=True):
            if isinstance(one, Hidden) or isinstance(form, Hidden):
                continue
            if one.smooth and not form.smooth:
                close = CloseForm(other.fit, form, math.sqrt(left))
                found.setdefault(one.slot, close)
    return found
