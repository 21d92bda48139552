"""Options for reading the columns of recordings."""

import dataclasses
import math
from typing import Annotated, Literal

import typer

from ._choices import choose
from ._options import Gaps


@dataclasses.dataclass(frozen=True)
class Files:
    """Options for files: columns, units and the handling of faulty files."""

    gaps: Gaps = "mend"
    columns: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="The names of all columns in order, with - for a column to skip "
            "(time_s,-,angle_rad); or new names for some columns, optionally with a "
            "factor, such as Y1=height_m*-8e-4.",
        ),
    ] = None
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ", help=("Samples per second, for files without a time column.")
        ),
    ] = None
    split: Annotated[
        str | None,
        typer.Option(
            metavar="COLUMN",
            help=(
                "Column with the recording number, for files that contain several "
                "recordings."
            ),
        ),
    ] = None

    def check(self) -> None:
        """Check the values of the options.

        Raises:
            ValueError: An option is invalid; the message names it.
        """
        choose("--gaps", self.gaps, ("mend", "refuse", "split"))
        if self.rate is not None and not (math.isfinite(self.rate) and self.rate > 0):
            raise ValueError(
                f"--rate is {self.rate:g}; give samples per second, such as 200."
            )
        self.named()

    @property
    def how(self) -> Literal["mend", "refuse", "split"]:
        """Return `gaps` with the type that the functions for reading files declare."""
        return self.gaps  # pyright: ignore

    def named(self) -> list[str] | dict[str, tuple[str, float]] | None:
        """Return `--columns` in the form that the functions for reading files expect.

        Raises:
            ValueError: Names and pairs are mixed, or a factor is not a number.
        """
        if self.columns is None:
            return None
        parts = [part.strip() for part in self.columns.split(",")]
        pairs = [part for part in parts if "=" in part]
        if not pairs:
            return parts
        if len(pairs) < len(parts) or not all(_is_pair(one) for one in pairs):
            raise ValueError(
                f"--columns is {self.columns[:100]!r}; give names separated by "
                "commas, such as time_s,angle_rad, or only pairs, such as "
                "t=time_s,Y1=height_m*-8e-4."
            )
        found = {}
        for pair in pairs:
            word, _, channel = pair.rpartition("=")
            name, _, factor = channel.partition("*")
            found[word.strip()] = name.strip(), float(factor or 1.0)
        return found


def _is_pair(part: str) -> bool:
    word, _, channel = part.rpartition("=")
    name, star, factor = channel.partition("*")
    try:
        known = not star or float(factor) != 0
    except ValueError:
        known = False
    return bool(word.strip() and name.strip()) and known
