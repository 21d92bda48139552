"""A parameter to fit, and prior knowledge about it."""

import dataclasses
import math
from collections.abc import Callable

from jaxtyping import Array

from ._model import Model


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A number of a model that may be fitted, and prior knowledge about it.

    Examples:
        >>> from jaxcam.fitting import Parameter
        >>> mass = Parameter("mass", lambda m: m.system.mass, tolerance=0.01, unit="kg")
        >>> round(mass.prior_stderr, 5)
        0.00577
    """

    name: str
    """Name of the parameter, used in tables and to free it."""
    where: Callable[[Model], Array]
    """Selects the number in a `Model`: `lambda m: m.system.stiffness`."""
    tolerance: float = math.inf
    """Largest deviation from `nominal`, as stated by the manufacturer: any value within
    it is equally likely. The fit uses a Gaussian of the same standard deviation,
    `tolerance / sqrt(3)`. The tolerance is infinite without prior knowledge.
    """
    nominal: float | None = None
    """Nominal value; default: that of the model."""
    scale: float | None = None
    """Size of a relevant change; by default the tolerance, or a hundredth of the value
    if there is none. The scale does not influence the result.
    """
    lower: float = -math.inf
    """Lower bound."""
    upper: float = math.inf
    """Upper bound."""
    per_record: bool = False
    """Whether every recording has a separate value."""
    unit: str = ""
    """Unit shown in tables."""
    known: tuple[float, ...] | None = None
    """A value for each recording, which no fit changes. `Problem.build` creates such
    parameters from the `constants` of recordings.
    """

    def __post_init__(self):
        if not self.tolerance > 0:
            raise ValueError(
                f"The parameter {self.name!r} has the tolerance {self.tolerance:g}; "
                f"give a positive one, or omit the parameter to keep it fixed."
            )
        if not self.lower < self.upper:
            raise ValueError(
                f"The bounds of {self.name!r} are {self.lower:g} and {self.upper:g}; "
                f"the lower one must be below the upper one."
            )

    @property
    def prior_stderr(self) -> float:
        """Standard deviation of the prior."""
        return self.tolerance / math.sqrt(3.0)

    def nominal_in(self, value: float) -> float:
        """Return the nominal value in a model in which the parameter has a value."""
        return value if self.nominal is None else self.nominal

    def size(self, value: float) -> float:
        """Return the size of a relevant change, positive."""
        if self.scale is not None:
            return self.scale
        if math.isfinite(self.tolerance):
            return self.tolerance
        return 0.01 * abs(value) if value else 1.0
