"""Describe the settings of a policy: the group and the meaning of each."""

import dataclasses
import enum
import functools
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
