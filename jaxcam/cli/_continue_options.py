"""Options of `jaxcam continue` and checks of their values."""

import dataclasses
from typing import Annotated

import typer

from ._axis import Axis, ordered_bounds
from ._checks import at_least, numbers
from ._choices import choose
from ._options import Highest, Lowest, Unit


ALGORITHMS = {
    "pseudo-arclength": "PseudoArclength",
    "moore-penrose": "MoorePenrose",
    "natural": "Natural",
}
DIRECTIONS = {"up": 1, "down": -1, "both": "both"}


@dataclasses.dataclass(frozen=True)
class BranchRange:
    """The parameter, its bounds, and its value at the start."""

    parameter: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Continuation parameter, such as speed, wall or profile.eccentricity.",
        ),
    ] = "speed"
    low: Lowest = None
    high: Highest = None
    unit: Unit = None
    at: Annotated[
        float | None,
        typer.Option(
            metavar="P",
            help=("Initial value of the parameter; default: that of the system."),
        ),
    ] = None

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the lowest and highest value of the parameter."""
        return ordered_bounds(self.low, self.high)

    def started(self, model, axis: Axis):
        """Return the system with the parameter at its initial value.

        Raises:
            ValueError: The parameter is unknown, or the start is out of bounds.
        """
        import equinox as eqx
        import jax.numpy as jnp

        from ._parameters import chosen_parameter, parameters, pick_by_name

        name, (low, high) = chosen_parameter(model, self.parameter), self.bounds
        usual = parameters(model)[name]
        value = usual / axis.unit if self.at is None else self.at
        if not low <= value <= high:
            raise ValueError(
                f"the branch starts at {name} = {value:g}, outside {low:g} to "
                f"{high:g}; change --at or the bounds."
            )
        first = jnp.asarray(axis.unit * value, dtype=float)
        return eqx.tree_at(pick_by_name(name), model, first)


@dataclasses.dataclass(frozen=True)
class Following:
    """The initial orbit, and the settings for following its branch."""

    state: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help=(
                "Initial guess for the orbit's state at time zero, such as 0.3,0; "
                "default: the orbit to which the motion converges."
            ),
        ),
    ] = None
    periods: Annotated[
        int | None,
        typer.Option(metavar="N", help="Period of the orbit, in forcing periods."),
    ] = None
    direction: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help=f"Direction in which to follow the branch: one of "
            f"{', '.join(DIRECTIONS)}.",
        ),
    ] = "both"
    algorithm: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help=f"Continuation algorithm: one of {', '.join(ALGORITHMS)}.",
        ),
    ] = "pseudo-arclength"
    max_points: Annotated[
        int,
        typer.Option(metavar="N", help="Maximum number of points in each direction."),
    ] = 300

    def check(self) -> None:
        """Check the values of the options.

        Raises:
            ValueError: An option is invalid; the message names it.
        """
        choose("--direction", self.direction, DIRECTIONS)
        choose("--algorithm", self.algorithm, ALGORITHMS)
        at_least("--periods", self.periods, 1)
        at_least("--max-points", self.max_points, 2)

    @property
    def guess(self):
        """Return the state given as the first guess of the orbit, or None."""
        import numpy as np

        if self.state is None:
            return None
        return np.array(numbers("--state", self.state, "0.3,0"))
