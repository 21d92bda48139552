"""Options of `jaxcam simulate` and checks of their values."""

import dataclasses
from typing import Annotated

import typer

from ._checks import check_finite, numbers
from ._choices import choose, ENGINES, ready, SOLVERS


@dataclasses.dataclass(frozen=True)
class RunOptions:
    """Start, end and integration options of a run."""

    state: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help="Initial state, such as 0.3,0, or the word 'release' for the release "
            "point of a sticking orbit. By default, 1,0 for the bouncing ball and "
            "0,0.1,-2 for the triple integrator; for other systems, the `start` state "
            "in the rig file or, if it gives none, the release point, or rest if "
            "there is no release point.",
        ),
    ] = None
    t0: Annotated[float, typer.Option(metavar="S", help="Initial time (s).")] = 0.0
    t1: Annotated[float | None, typer.Option(metavar="S", help="Final time (s).")] = (
        None
    )
    turns: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            help=(
                "Duration in forcing periods (cam cycles), instead of --t1; default: "
                "10."
            ),
        ),
    ] = None
    tolerance: Annotated[
        float, typer.Option(metavar="E", help="Error tolerance per step.")
    ] = 1e-10
    solver: Annotated[
        str,
        typer.Option(metavar="NAME", help=f"Solver: one of {', '.join(SOLVERS)}."),
    ] = "dopri8"
    engine: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=(
                "Engine: loop, or diffeqsolve (one diffrax call per flight; also "
                "supports implicit solvers)."
            ),
        ),
    ] = None

    def check(self) -> None:
        """Check the values of the options.

        Raises:
            ValueError: An option is invalid; the message names it.
        """
        choose("--solver", self.solver, SOLVERS)
        choose("--engine", self.chosen_engine, ENGINES)

    @property
    def chosen_engine(self) -> str:
        """Return the chosen engine; by default, the one that the solver needs."""
        implicit = self.solver.startswith("kvaerno")
        return self.engine or ("diffeqsolve" if implicit else "loop")

    def start(self, name: str):
        """Return the initial state; None for the release point."""
        import numpy as np

        if self.state == "release":
            return None
        if self.state is None:
            start = ready(name).state
            return None if start is None else np.array(start)
        words = "0.3,0, or the word release"
        return np.array(numbers("--state", self.state, words, finite=False))

    def end(self, name: str, model) -> float:
        """Return the end time (s)."""
        check_finite("--t0", self.t0)
        check_finite("--t1", self.t1)
        check_finite("--turns", self.turns)
        if self.t1 is not None and self.turns is not None:
            raise ValueError("Give --t1 or --turns, not both.")
        if self.t1 is not None:
            return self.t1
        usual = ready(name)
        turns = usual.turns if self.turns is None else self.turns
        if turns is None:
            return self.t0 + usual.duration
        if model.period is None:
            raise ValueError(f"{name} has no forcing period; give --t1.")
        if not turns > 0:
            raise ValueError(f"--turns is {turns:g}; give a positive number.")
        # reject a speed of zero, for which the period would be infinite
        model.check()
        return self.t0 + turns * float(model.period)
