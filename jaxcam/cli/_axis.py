"""Name, unit and bounds of the parameter that a command varies."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from ._checks import check_finite
from ._choices import CAM


class Axis(NamedTuple):
    """A parameter in the unit used on the command line.

    Speeds are given in rpm and converted to rad/s; other parameters are in SI units.
    """

    parameter: str
    unit: float
    """Size of the unit used on the command line, in SI units; pi/30 for rpm."""
    symbol: str = ""
    """Symbol of this unit; empty if it is unknown."""

    @staticmethod
    def of(
        parameter: str,
        system: str,
        units: Mapping[str, str] | None = None,
        unit: str | None = None,
    ) -> "Axis":
        """Return the axis of a parameter of a system, both given by name.

        **Arguments:** `units`: the known units of parameters, by parameter name;
        `unit`: that of this parameter, if it is given on the command line.

        Raises:
            ValueError: The speed of a cam-follower is always in rpm.
        """
        if parameter == "speed" and system == CAM:
            if unit not in (None, "rpm"):
                raise ValueError(f"--unit is {unit!r}, but the speed is in rpm.")
            return Axis(parameter, math.pi / 30, "rpm")
        return Axis(parameter, 1.0, unit or (units or {}).get(parameter, ""))

    @property
    def in_rpm(self) -> bool:
        return self.unit != 1.0

    @property
    def name(self) -> str:
        """Name of the parameter in sentences and headings, with its unit if known."""
        return f"{self.parameter} in {self.symbol}" if self.symbol else self.parameter

    def shown(self, value: float) -> str:
        """Return a value, given in SI units, in the unit of the command line."""
        number = f"{value / self.unit:.6g}"
        return f"{number} {self.symbol}" if self.symbol else number

    @property
    def label(self) -> tuple[str, str]:
        """Name and unit of the parameter, for the axes of figures."""
        return self.parameter, self.symbol


def ordered_bounds(low: float | None, high: float | None) -> tuple[float, float]:
    """Return the values of `--from` and `--to`.

    Raises:
        ValueError: A value is missing or not finite, or the first is not the lower one.
    """
    if low is None or high is None:
        raise ValueError(
            "Give the lowest and the highest value of the parameter: --from A --to B."
        )
    check_finite("--from", low)
    check_finite("--to", high)
    if not low < high:
        raise ValueError(
            f"--from {low:g} --to {high:g} has the higher value first; give the lower "
            "value first and choose --direction."
        )
    return low, high
