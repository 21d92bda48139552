"""Options of `jaxcam diagram` and checks of their values."""

import dataclasses
from typing import Annotated

import typer

from ._axis import ordered_bounds
from ._checks import at_least, check_size, numbers
from ._choices import choose
from ._options import Highest, Lowest, Unit


DIRECTIONS = ("each", "up", "down", "both")
SECTIONS = ("stroboscope", "impacts")


@dataclasses.dataclass(frozen=True)
class Sweep:
    """The parameter to vary, and the sampling at each value."""

    parameter: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Bifurcation parameter, such as speed or omega."
        ),
    ] = "speed"
    low: Lowest = None
    high: Highest = None
    unit: Unit = None
    points: Annotated[
        int, typer.Option(metavar="N", help="Number of parameter values.")
    ] = 200
    turns: Annotated[
        int, typer.Option(metavar="N", help="Number of forcing periods at each value.")
    ] = 300
    keep: Annotated[
        int, typer.Option(metavar="N", help="Number of final periods to draw.")
    ] = 100
    direction: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help=(
                "up, down or both: start each simulation from the final state at the "
                "previous value; each: start all simulations from the same state."
            ),
        ),
    ] = "both"
    dwell: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help="Settling time and recording time (s) at each value, as in an "
            "experiment; replaces --turns and --keep.",
        ),
    ] = None
    section: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help=f"Sample once per period or at each impact: {' or '.join(SECTIONS)}.",
        ),
    ] = "stroboscope"

    def check(self) -> None:
        """Check the values of the options.

        Raises:
            ValueError: An option is invalid; the message names it.
        """
        choose("--direction", self.direction, DIRECTIONS)
        choose("--section", self.section, SECTIONS)
        ordered_bounds(self.low, self.high)
        at_least("--points", self.points, 1)
        at_least("--keep", self.keep, 1)
        at_least("--turns", self.turns, self.keep)

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the lowest and highest value of the parameter."""
        return ordered_bounds(self.low, self.high)

    @property
    def seconds(self) -> tuple[float, ...] | None:
        """Return the settling and recording times (s), or None without `--dwell`."""
        if self.dwell is None:
            return None
        found = numbers("--dwell", self.dwell, "60,10")
        if len(found) != 2:
            raise ValueError(
                f"--dwell is {self.dwell!r}; give the settling time and the recording "
                "time in seconds, such as 60,10."
            )
        return found


@dataclasses.dataclass(frozen=True)
class Starts:
    """Initial states of the motions."""

    state: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help="Initial state; default: the `start` state of the rig "
            "file or, if it gives none, a state in sustained contact, or rest.",
        ),
    ] = None
    starts: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help=("Use N random initial states per value, between --low and --high."),
        ),
    ] = None
    corner: Annotated[
        str | None,
        typer.Option(
            "--low",
            metavar="A,B",
            help=("Lower corner of the region of random initial states."),
        ),
    ] = None
    opposite: Annotated[
        str | None,
        typer.Option(
            "--high",
            metavar="A,B",
            help=("Upper corner of the region of random initial states."),
        ),
    ] = None
    seed: Annotated[
        int, typer.Option(metavar="N", help=("Seed of the random initial states."))
    ] = 0

    def check(self, sweep: Sweep) -> None:
        """Check the values of the options.

        Raises:
            ValueError: An option is invalid; the message names it.
        """
        at_least("--starts", self.starts, 1)
        at_least("--seed", self.seed, 0)
        counts = sweep.points, self.starts or 1, sweep.keep
        check_size("--points, --starts and --keep", *counts)
        if self.starts is not None and (self.corner is None or self.opposite is None):
            raise ValueError(
                "--starts needs the region of initial states: --low A,B --high A,B."
            )
        if self.starts is not None and self.state is not None:
            raise ValueError("Give --state or --starts, not both.")

    @property
    def given(self) -> tuple[float, ...] | None:
        """Return the initial state given by `--state`, or None."""
        return None if self.state is None else numbers("--state", self.state, "0.4,1.8")

    @property
    def box(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the corners of the region of random initial states."""
        low = numbers("--low", str(self.corner), "0.34,-2")
        return low, numbers("--high", str(self.opposite), "0.5,3")

    def states(self, sweep: Sweep):
        """Return the initial states in the form used by [`jaxcam.sweeps.diagram`][]."""
        from ..sweeps import monte_carlo

        if self.starts is None:
            return self.given
        each = sweep.points if sweep.direction == "each" else None
        return monte_carlo(*self.box, self.starts, self.seed, each)
