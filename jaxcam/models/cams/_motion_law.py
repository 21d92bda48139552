"""Motion laws for the segments of a cam motion program."""

import math
from typing import NamedTuple


class LawPiece(NamedTuple):
    """A piece of a motion law: `polynomial(u) + amplitude sin(frequency u + phase)`."""

    end: float
    """Fraction u at which the piece ends."""
    polynomial: tuple[float, ...]
    """Coefficients, lowest power first."""
    amplitude: float = 0.0
    """Amplitude of the sine."""
    frequency: float = 0.0
    """Frequency of the sine (rad per unit of u)."""
    phase: float = 0.0
    """Phase of the sine (rad)."""


class MotionLaw(NamedTuple):
    """A normalised rise from 0 to 1 as the fraction u of the segment goes from 0 to 1.

    Define a law of your own as a sequence of [`jaxcam.models.cams.LawPiece`][]; the
    last piece must end at 1.
    """

    name: str
    """Name of the law."""
    pieces: tuple[LawPiece, ...]
    """Pieces of the law, in order."""


_PI = math.pi
_SINE = 1 / (4 + _PI)


MOTION_LAWS: dict[str, MotionLaw] = {
    law.name: law
    for law in (
        MotionLaw("dwell", (LawPiece(1.0, (0.0,)),)),
        MotionLaw("constant velocity", (LawPiece(1.0, (0.0, 1.0)),)),
        MotionLaw(
            "constant acceleration",
            (LawPiece(0.5, (0.0, 0.0, 2.0)), LawPiece(1.0, (-1.0, 4.0, -2.0))),
        ),
        MotionLaw("cubic", (LawPiece(1.0, (0.0, 0.0, 3.0, -2.0)),)),
        MotionLaw("simple harmonic", (LawPiece(1.0, (0.5,), 0.5, _PI, -_PI / 2),)),
        MotionLaw(
            "cycloidal",
            (LawPiece(1.0, (0.0, 1.0), -0.5 / _PI, 2 * _PI),),
        ),
        MotionLaw("3-4-5", (LawPiece(1.0, (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)),)),
        MotionLaw(
            "4-5-6-7",
            (LawPiece(1.0, (0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0)),),
        ),
        MotionLaw(
            "modified sine",
            (
                LawPiece(0.125, (0.0, _PI * _SINE), -_SINE / 4, 4 * _PI),
                LawPiece(
                    0.875,
                    (2 * _SINE, _PI * _SINE),
                    -9 * _SINE / 4,
                    4 * _PI / 3,
                    _PI / 3,
                ),
                LawPiece(1.0, (4 * _SINE, _PI * _SINE), -_SINE / 4, 4 * _PI),
            ),
        ),
    )
}
"""The laws available by name for a [`jaxcam.models.Segment`][] (R. L. Norton, Cam
Design and Manufacturing Handbook, 2002, chapters 2 to 4). "cubic" is 3u^2 - 2u^3, the
only cubic with zero velocity at both ends; "modified sine" is a cycloidal law with four
times the base frequency in the first and last eighth, joined by a sine with a third of
that frequency.
"""
