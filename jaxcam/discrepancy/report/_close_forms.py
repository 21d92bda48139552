"""Find the closest parametric forms of functions that no form fully represents."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ...fitting import Fit
from ..search import Free, Hidden, Missing


class CloseForm(NamedTuple):
    """A form that explains slightly less than the function it replaces."""

    fit: Fit
    form: Free
    # rms difference from the function, relative to its size
    error: float

    @property
    def percent(self) -> float:
        return max(100 * self.error, 0.01)


def close_forms(
    missing: Missing,
    others: Sequence[Missing],
    explained: Mapping[str, float],
    small: float,
) -> dict[str, CloseForm]:
    """Return the closest form of each function that no form represents, by slot.

    **Arguments:** the functions found; other fits, the best first; the cost that each
    function explains, by its label; and the fraction of this cost that a form may leave
    unexplained.
    """
    found: dict[str, CloseForm] = {}
    for other in others:
        loss = max(other.fit.cost - missing.fit.cost, 0.0)
        one, form = _only_form(missing, other)
        if one is None or form is None or one.slot in found:
            continue
        least = explained.get(one.label, 0.0)
        if loss < small * least:
            found[one.slot] = CloseForm(other.fit, form, math.sqrt(loss / least))
    return found


def _only_form(missing: Missing, other: Missing) -> tuple[Free | None, Free | None]:
    """Return the only function that another fit replaces by a form, and this form;
    `None` for both if the fits differ in any other way.
    """
    nothing = None, None
    if other.names != missing.names or len(other.functions) != len(missing.functions):
        return nothing
    pairs = [
        (one, form)
        for one, form in zip(missing.functions, other.functions, strict=True)
        if one.label != form.label or _form_of(one) != _form_of(form)
    ]
    if len(pairs) != 1:
        return nothing
    ((one, form),) = pairs
    if isinstance(one, Hidden) or isinstance(form, Hidden):
        return nothing
    alike = one.label == form.label
    if one.across is not None:
        alike = set(one.arguments) == set(form.arguments)
    same = alike and one.smooth and not form.smooth
    return (one, form) if same else nothing


def _form_of(part: Free | Hidden) -> str | None:
    return None if isinstance(part, Hidden) else part.form
