"""A number with its standard error."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Value:
    """A number with its standard error and unit."""

    value: float
    """The number."""
    stderr: float
    """Standard error."""
    unit: str = ""
    """Unit."""
