"""Options of `jaxcam basins` and checks of their values."""

import dataclasses
from typing import Annotated

import typer

from ._checks import at_least, check_size, numbers
from ._choices import CAM


# default corners of the grid, which enclose a region in which impacts occur
_BOXES = {
    CAM: ((0.33, -3.0), (0.55, 3.0)),
    "impact-oscillator": ((-1.0, -2.0), (0.0, 2.0)),
}


@dataclasses.dataclass(frozen=True)
class Cells:
    """The grid of initial states, and the duration of each run."""

    low: Annotated[
        str | None,
        typer.Option(metavar="A,B", help="Lower corner of the grid of initial states."),
    ] = None
    high: Annotated[
        str | None,
        typer.Option(metavar="A,B", help="Upper corner of the grid of initial states."),
    ] = None
    shape: Annotated[
        str,
        typer.Option(metavar="K,L", help="Number of cells along each state component."),
    ] = "128,128"
    turns: Annotated[
        int,
        typer.Option(metavar="N", help="Number of forcing periods per simulation."),
    ] = 100
    keep: Annotated[
        int,
        typer.Option(
            metavar="N",
            help="Number of final periods from which attractors are identified.",
        ),
    ] = 24
    reruns: Annotated[
        int,
        typer.Option(
            metavar="N",
            help=(
                "Maximum number of times that the length of a simulation is doubled "
                "while its motion is not periodic."
            ),
        ),
    ] = 1

    def check(self, system: str) -> None:
        """Check the values of the options.

        Raises:
            ValueError: An option is invalid; the message names it.
        """
        self.corners(system)
        cells = self.counts
        at_least("--keep", self.keep, 2)
        at_least("--turns", self.turns, self.keep)
        at_least("--reruns", self.reruns, 0)
        check_size("--shape and --keep", *(max(1, k) for k in cells), self.keep)

    def corners(self, system: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the corners of the grid; their defaults depend on the system."""
        box = _BOXES.get(system)
        if box is None and (self.low is None or self.high is None):
            raise ValueError(
                f"{system} has no default grid; give its corners: --low A,B --high A,B."
            )
        low, high = box or ((), ())
        if self.low is not None:
            low = numbers("--low", self.low, "0.34,-2")
        if self.high is not None:
            high = numbers("--high", self.high, "0.34,-2")
        return low, high

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of cells along each component."""
        cells = numbers("--shape", self.shape, "128,128")
        if any(cell != int(cell) for cell in cells):
            raise ValueError(f"--shape is {self.shape!r}; give whole numbers.")
        return tuple(map(int, cells))
