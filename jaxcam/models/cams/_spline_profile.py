"""A cam profile given by a table of measured or designed points."""

import jax
import jax.numpy as jnp
import numpy as np

from .._parameters import as_parameter, is_concrete, parameter
from ._profile import CamProfile


_TURN = 2 * np.pi
_FEWEST_POINTS = 6
# Matrix that maps the value, slope and curvature of a quintic c0 + c1 u + ... + c5 u^5
# at 0 and at 1 to its coefficients
_HERMITE = np.array(
    [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
        [-10.0, -6.0, -1.5, 10.0, -4.0, 0.5],
        [15.0, 8.0, 1.5, -15.0, 7.0, -1.0],
        [-6.0, -3.0, -0.5, 6.0, -3.0, 0.5],
    ]
)


class SplineProfile(CamProfile):
    """Periodic quintic spline through a table of points, with four continuous
    derivatives.

    The coefficients are computed once per simulation, from a dense linear system with
    twice as many unknowns as points; a table of thousands of points should be smoothed
    and reduced first.

    Raises:
        ValueError: The table is too short, not finite or not increasing, spans more
            than a turn, does not close, or appears to be in degrees.

    Examples:
        >>> from jaxcam.models import SplineProfile
        >>> angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
        >>> profile = SplineProfile(angles, 0.01 * np.cos(angles)).prepared()
        >>> round(float(profile(0.0)), 6)
        0.01
    """

    angles: jax.Array
    """Cam angles (rad), shape `(points,)`, strictly increasing within one turn; they
    need not be evenly spaced. The first point may be repeated one turn later.
    """
    lifts: jax.Array
    """Contact angles of the follower at `angles` (rad), shape `(points,)`."""

    def __init__(self, angles, lifts):
        angles, lifts = as_parameter(angles), as_parameter(lifts)
        if angles.ndim != 1 or angles.shape != lifts.shape:
            raise ValueError(
                "Give one list of cam angles and one of lifts of the same length; "
                f"their shapes are {angles.shape} and {lifts.shape}."
            )
        if is_concrete(angles, lifts):
            keep = _checked_table(np.asarray(angles), np.asarray(lifts))
            angles, lifts = angles[:keep], lifts[:keep]
        self.angles = angles
        self.lifts = lifts

    def __call__(self, cam_angle) -> jax.Array:
        return self.prepared()(cam_angle)

    def prepared(self) -> "PiecewiseProfile":
        """Return the polynomial pieces of the spline, differentiable in the table."""
        widths = jnp.diff(self.angles, append=self.angles[:1] + _TURN)
        coefficients = _quintic_pieces(widths, self.lifts)
        return PiecewiseProfile(self.angles, widths, coefficients)

    def check(self) -> None:
        """Raise `ValueError` for an invalid table."""
        _checked_table(np.asarray(self.angles), np.asarray(self.lifts))


class PiecewiseProfile(CamProfile):
    """A periodic profile of polynomial pieces, created by `SplineProfile.prepared`."""

    starts: jax.Array = parameter()
    """Cam angle at which each piece begins (rad), shape `(pieces,)`."""
    widths: jax.Array = parameter()
    """Length of each piece (rad), shape `(pieces,)`."""
    coefficients: jax.Array = parameter()
    """Coefficients in powers of the fraction of the piece, lowest first, shape
    `(pieces, order)`.
    """

    def __call__(self, cam_angle) -> jax.Array:
        angle = jnp.mod(cam_angle - self.starts[0], _TURN)
        starts = self.starts - self.starts[0]
        # the search is unrolled, because an inner loop could not be fused with the
        # other operations in the loop of a simulation
        after = jnp.searchsorted(starts, angle, side="right", method="scan_unrolled")
        piece = after - 1
        local = (angle - starts[piece]) / self.widths[piece]
        coefficients = self.coefficients[piece]
        value = coefficients[..., -1]
        for k in reversed(range(self.coefficients.shape[-1] - 1)):
            value = coefficients[..., k] + local * value
        return value


@jax.jit
def _quintic_pieces(widths, lifts):
    # The unknowns are the slope and the curvature at each point. Together with the
    # lifts, they define each piece as a quintic Hermite polynomial. Continuity of the
    # third and fourth derivatives at each point gives as many linear equations as there
    # are unknowns. The widths are divided by their mean, so that the equations are well
    # balanced for tables of any length.
    points = widths.shape[0]
    scale = _TURN / points
    h = widths / scale
    hermite = jnp.asarray(_HERMITE, dtype=widths.dtype)
    following = np.roll(np.arange(points), -1)

    # rows that map the value, h slope and h^2 curvature at both ends of a piece to its
    # third and fourth derivatives, at its start and at its end
    third = 6 * hermite[3], 6 * hermite[3] + 24 * hermite[4] + 60 * hermite[5]
    fourth = 24 * hermite[4], 24 * hermite[4] + 120 * hermite[5]
    powers = jnp.stack([jnp.ones_like(h), h, h**2] * 2, axis=-1)

    # select the columns that belong to the points i, i + 1 and i + 2
    here = np.eye(points)
    after, second = np.roll(here, 1, axis=1), np.roll(here, 2, axis=1)
    rows = []
    for derivative, order in ((third, 3), (fourth, 4)):
        # the derivative at the end of piece i equals that at the start of piece i + 1
        weights = powers / h[:, None] ** order
        end = derivative[1][None] * weights
        begin = (derivative[0][None] * weights)[following]
        rows.append(
            [
                end[:, k, None] * here
                + (end[:, k + 3] - begin[:, k])[:, None] * after
                - begin[:, k + 3, None] * second
                for k in range(3)
            ]
        )
    known = jnp.concatenate([row[0] for row in rows]) @ lifts
    unknown = jnp.block([row[1:] for row in rows])
    slope, curvature = jnp.linalg.solve(unknown, -known).reshape(2, points)

    ends = jnp.stack([lifts, slope, curvature], axis=-1)
    ends = jnp.concatenate([ends, ends[following]], axis=-1) * powers
    return ends @ hermite.T


def _checked_table(angles, lifts) -> int:
    """Return the number of points to keep: all, or all except a repetition of the
    first.
    """
    if len(angles) < _FEWEST_POINTS:
        raise ValueError(
            f"Give at least {_FEWEST_POINTS} points of the cam profile; there are "
            f"{len(angles)}."
        )
    if not (np.all(np.isfinite(angles)) and np.all(np.isfinite(lifts))):
        raise ValueError(
            "Remove the points of the cam profile whose angle or lift is not finite."
        )
    if not np.all(np.diff(angles) > 0):
        index = int(np.argmin(np.diff(angles) > 0))
        raise ValueError(
            "Sort the cam profile by strictly increasing cam angle: point "
            f"{index + 1} at {angles[index + 1]} is not greater than {angles[index]}."
        )
    span = angles[-1] - angles[0]
    if span > _TURN * (1 + 1e-6):
        hint = "; it looks like degrees, see `numpy.deg2rad`" if span > 90 else ""
        raise ValueError(
            "Give the cam angles in radians and within one turn: the table spans "
            f"{span:g}{hint}."
        )
    if np.max(np.abs(lifts)) >= np.pi / 2:
        raise ValueError(
            "Give the lifts in radians, between -pi/2 and pi/2: the largest is "
            f"{np.max(np.abs(lifts)):g}, which looks like degrees."
        )
    if span < _TURN * (1 - 1e-6):
        return len(angles)
    jump = abs(lifts[-1] - lifts[0])
    if jump > 1e-6:
        raise ValueError(
            "The cam profile is not closed: its last point is the first one a turn "
            f"later, but their lifts differ by {jump:.2e} rad; make them equal."
        )
    return len(angles) - 1
