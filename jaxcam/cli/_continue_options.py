"""The options of `jaxcam continue`, and what is asked of their values."""

import dataclasses
from typing import Annotated

import typer

from ._axis import Axis, ordered_bounds
from ._checks import at_least, numbers
from ._choices import choose
from ._options import Highest, Lowest


ALGORITHMS = {
    "pseudo-arclength": "PseudoArclength",
    "moore-penrose": "MoorePenrose",
    "natural": "Natural",
}
DIRECTIONS = {"up": 1, "down": -1, "both": "both"}


@dataclasses.dataclass(frozen=True)
class BranchRange:
    """The parameter, its bounds, and where the branch starts."""

    parameter: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="The parameter that varies, such as speed or wall or "
            "profile.eccentricity.",
        ),
    ] = "speed"
    low: Lowest = None
    high: Highest = None
    at: Annotated[
        float | None,
        typer.Option(
            metavar="P", help="Its value at the start; default that of the system."
        ),
    ] = None

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value."""
        return ordered_bounds(self.low, self.high)

    def started(self, model, axis: Axis):
        """The system with the parameter at its first value.

        Raises:
            ValueError: For no such parameter, or a start outside.
        """
        import equinox as eqx
        import jax.numpy as jnp

        from ._parameters import parameters, pick_by_name

        name, (low, high) = self.parameter, self.bounds
        known = {k: v for k, v in parameters(model).items() if not isinstance(v, list)}
        if name not in known:
            raise ValueError(
                f"--parameter {name}: there is no such parameter; the parameters are "
                f"{', '.join(known)}."
            )
        value = known[name] / axis.unit if self.at is None else self.at
        if not low <= value <= high:
            raise ValueError(
                f"the branch starts at {name} = {value:g}, outside {low:g} to "
                f"{high:g}; choose the start with --at, or other bounds."
            )
        first = jnp.asarray(axis.unit * value, dtype=float)
        return eqx.tree_at(pick_by_name(name), model, first)


@dataclasses.dataclass(frozen=True)
class Following:
    """The orbit to begin with, and how its branch is followed."""

    state: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help="A guess of the orbit's state at time zero, such as 0.3,0; default "
            "the orbit on which the motion settles.",
        ),
    ] = None
    periods: Annotated[
        int | None,
        typer.Option(metavar="N", help="Forcing periods until the orbit repeats."),
    ] = None
    direction: Annotated[
        str, typer.Option(metavar="NAME", help=f"One of {', '.join(DIRECTIONS)}.")
    ] = "both"
    algorithm: Annotated[
        str, typer.Option(metavar="NAME", help=f"One of {', '.join(ALGORITHMS)}.")
    ] = "pseudo-arclength"
    max_points: Annotated[
        int, typer.Option(metavar="N", help="Points in each direction.")
    ] = 300

    def check(self) -> None:
        """

        Raises:
            ValueError: That names the option at fault.
        """
        choose("--direction", self.direction, DIRECTIONS)
        choose("--algorithm", self.algorithm, ALGORITHMS)
        at_least("--periods", self.periods, 1)
        at_least("--max-points", self.max_points, 2)

    @property
    def guess(self):
        """A state near the orbit, or None."""
        import numpy as np

        if self.state is None:
            return None
        return np.array(numbers("--state", self.state, "0.3,0"))
