"""A number with its error."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Value:
    """A number with its standard error and unit."""

    value: float
    stderr: float
    unit: str = ""
