"""Describe the settings of a policy: the group and the meaning of each."""

import dataclasses
import enum
import functools
import math
from collections.abc import Iterable
from typing import Any, NamedTuple


class Group(enum.StrEnum):
    """The part of a diagnosis that a setting of a policy affects."""

    VERDICT = "verdict"
    BUDGET = "budget"
    REPORT = "report"


def _number(group: Group, default: Any, says: str) -> Any:
    return dataclasses.field(default=default, metadata={"group": group, "says": says})


decides = functools.partial(_number, Group.VERDICT)
bounds = functools.partial(_number, Group.BUDGET)
shows = functools.partial(_number, Group.REPORT)


class Setting(NamedTuple):
    """One setting of a policy: its name, value, group and meaning."""

    name: str
    value: Any
    group: Group
    says: str


def has_several(value: object) -> bool:
    """Return whether a setting has several values."""
    return isinstance(value, tuple)


def check(settings: Iterable[Setting]) -> None:
    """Raise `ValueError` unless all numbers are positive and finite, and probabilities
    and fractions are below 1; `functions` and `elements` may be 0.
    """
    for setting in settings:
        if setting.name in ("false_alarms", "confidence", "explains", "form_error"):
            if not 0 < setting.value < 1:
                raise ValueError(
                    f"Policy: `{setting.name}` is {setting.value!r}; give a number "
                    "between 0 and 1."
                )
        least = -1 if setting.name in ("functions", "elements") else 0
        low = min(setting.value) if has_several(setting.value) else setting.value
        if not low > least or not math.isfinite(low):
            raise ValueError(
                f"Policy: `{setting.name}` is {setting.value!r}; give positive numbers."
            )
