"""Motion programs of cams: the motion of the follower in each part of a turn."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._parameters import as_parameter, is_concrete, parameter, require_positive
from ._motion_law import MOTION_LAWS, MotionLaw
from ._profile import CamProfile


_TURN = 2 * np.pi
_CLOSED = 1e-9
"""Allowed closing error due to rounding, relative to the turn or the largest rise."""


class Segment(NamedTuple):
    """One segment of a motion program.

    Examples:
        >>> from jaxcam.models import Segment
        >>> Segment("cycloidal", np.pi / 2, 0.01).law
        'cycloidal'
    """

    law: str | MotionLaw
    """A name in [`jaxcam.models.cams.MOTION_LAWS`][], or a
    [`jaxcam.models.cams.MotionLaw`][]."""
    width: Any
    """Cam angle of the segment (rad)."""
    rise: Any = 0.0
    """Change of the lift over the segment; negative for a fall, 0 for a dwell."""


class Joint(NamedTuple):
    """Joints of a motion program, and the jumps at each joint.

    `jumps`, shape `(joints, 4)`: jumps of lift, velocity, acceleration and jerk, per
    radian of the cam.
    """

    angle: Float[Array, " joints"]
    """Cam angle of each joint (rad), shape `(joints,)`."""
    jumps: Float[Array, "joints 4"]
    """Jumps of lift, velocity, acceleration and jerk, per radian of the cam, shape
    `(joints, 4)`."""


class MotionProgram(CamProfile):
    """A cam profile that consists of consecutive segments and is closed over a turn.

    The lift is an angle (rad) for an oscillating follower and a length (m) for a
    translating one. The segments are traversed in order if the cam angle increases,
    which for [`jaxcam.models.CamFollower`][] means `rotation="counterclockwise"`. The
    program is created from a list of [`jaxcam.models.Segment`][], whose widths must add
    up to one turn and whose rises must add up to zero.

    Raises:
        ValueError: A law is unknown, or the program does not close.

    Examples:
        >>> from jaxcam.models import MotionProgram, Segment
        >>> rises = (0.01, -0.01)
        >>> program = MotionProgram([Segment("cycloidal", np.pi, r) for r in rises])
        >>> round(float(program(np.pi)), 6)
        0.01
    """

    widths: jax.Array
    """Cam angle of each segment (rad)."""
    rises: jax.Array
    """Change of the lift over each segment."""
    base: jax.Array
    """Lift at zero cam angle, where the first segment begins."""
    laws: tuple[MotionLaw, ...] = eqx.field(static=True)
    """Law of each segment."""

    def __init__(self, segments: Iterable[Segment], base=0.0):
        segments = [Segment(*segment) for segment in segments]
        if not segments:
            raise ValueError("Give at least one segment of the motion program.")
        self.laws = tuple(_law(segment.law) for segment in segments)
        self.widths = as_parameter([segment.width for segment in segments])
        self.rises = as_parameter([segment.rise for segment in segments])
        self.base = as_parameter(base)
        if is_concrete(self.widths, self.rises, self.base):
            self.check()

    def __call__(self, cam_angle) -> jax.Array:
        return self.prepared()(cam_angle)

    def prepared(self) -> "MotionPieces":
        """Return the program as a table of pieces, differentiable in widths and
        rises.
        """
        ends = jnp.cumsum(self.widths)
        begins = ends - self.widths
        lifts = self.base + jnp.cumsum(self.rises) - self.rises
        owner, before, coefficients, waves = _table(self.laws)
        widths, rises = self.widths[owner], self.rises[owner]
        heights = jnp.zeros_like(coefficients).at[:, 0].set(lifts[owner])
        return MotionPieces(
            starts=begins[owner] + before * widths,
            origins=begins[owner],
            widths=widths,
            coefficients=heights + rises[:, None] * coefficients,
            amplitudes=rises * waves[:, 0],
            frequencies=waves[:, 1],
            phases=waves[:, 2],
        )

    def derivatives(self, cam_angle) -> Float[Array, "... 4"]:
        """Return lift, velocity, acceleration and jerk (s, v, a, j) per radian of the
        cam.

        At a joint, these are the values just after it.

        Returns:
            The values s, v, a and j, shape `(..., 4)`.
        """
        pieces = self.prepared()
        return pieces.jet(pieces.local(cam_angle)[0], cam_angle)

    def joints(self) -> Joint:
        """Return the joints of the pieces, with the jumps of lift, velocity,
        acceleration and jerk.

        Laws that consist of several pieces have joints inside their segment.

        Returns:
            A [`jaxcam.models.cams.Joint`][].
        """
        pieces = self.prepared()
        count = pieces.starts.shape[0]
        here = np.arange(count)
        previous = np.roll(here, 1)
        ends = jnp.roll(pieces.ends(), 1)
        after = pieces.jet(here, pieces.starts)
        return Joint(pieces.starts, after - pieces.jet(previous, ends))

    def check(self) -> None:
        """Raise `ValueError` for a program that does not close."""
        require_positive(widths=self.widths)
        turn = float(jnp.sum(self.widths))
        if abs(turn - _TURN) > _CLOSED * _TURN:
            hint = "; they look like degrees" if turn > 90 else ""
            raise ValueError(
                "The widths of the segments must add up to one turn, 2 pi, but they "
                f"add up to {turn:g} rad{hint}."
            )
        for law, rise in zip(self.laws, np.asarray(self.rises), strict=True):
            if law.name == "dwell" and rise != 0:
                raise ValueError(f"A dwell must have a rise of 0, not {rise:g}.")
        scale = float(jnp.max(jnp.abs(self.rises)))
        total = float(jnp.sum(self.rises))
        if not abs(total) <= _CLOSED * max(scale, 1e-300):
            raise ValueError(
                "The rises and falls of the segments must add up to zero, but they add "
                f"up to {total:g}."
            )


class MotionPieces(CamProfile):
    """A motion program as a table of pieces, each the sum of a polynomial and a sine,
    created by `MotionProgram.prepared`.
    """

    starts: jax.Array = parameter()
    """Cam angle at which each piece begins (rad), shape `(pieces,)`."""
    origins: jax.Array = parameter()
    """Cam angle at which the fraction u is zero (rad), shape `(pieces,)`."""
    widths: jax.Array = parameter()
    """Cam angle over which u increases by one (rad), shape `(pieces,)`."""
    coefficients: jax.Array = parameter()
    """Coefficients of `polynomial(u)`, lowest power first, shape `(pieces, powers)`."""
    amplitudes: jax.Array = parameter()
    """Amplitude in `amplitude sin(frequency u + phase)`, shape `(pieces,)`."""
    frequencies: jax.Array = parameter()
    """Frequency of the sine, shape `(pieces,)`."""
    phases: jax.Array = parameter()
    """Phase of the sine, shape `(pieces,)`."""

    def __call__(self, cam_angle) -> jax.Array:
        piece, u = self.local(cam_angle)
        coefficients = self.coefficients[piece]
        value = coefficients[..., -1]
        for k in reversed(range(self.coefficients.shape[-1] - 1)):
            value = coefficients[..., k] + u * value
        wave = jnp.sin(self.frequencies[piece] * u + self.phases[piece])
        return value + self.amplitudes[piece] * wave

    def local(self, cam_angle):
        """Return the piece at an angle, and the fraction u of its segment."""
        angle = jnp.mod(cam_angle, _TURN)
        # the search is unrolled, because an inner loop could not be fused with the
        # other operations in the loop of a simulation
        after = jnp.searchsorted(
            self.starts, angle, side="right", method="scan_unrolled"
        )
        piece = after - 1
        return piece, (angle - self.origins[piece]) / self.widths[piece]

    def ends(self) -> Float[Array, " pieces"]:
        """Return the cam angle at which each piece ends (rad), shape `(pieces,)`."""
        turn = jnp.full_like(self.starts[:1], _TURN)
        return jnp.concatenate([self.starts[1:], turn])

    def jet(self, piece, cam_angle) -> Float[Array, "... 4"]:
        """Return the value and the first three derivatives of the given pieces,
        continued to any angle.

        A joint has a value on each side; the choice of piece selects the side.
        """
        cam_angle = jnp.asarray(cam_angle, dtype=float)
        angle = jnp.where(cam_angle == _TURN, cam_angle, jnp.mod(cam_angle, _TURN))
        width = self.widths[piece]
        u = (angle - self.origins[piece]) / width
        coefficients = self.coefficients[piece]
        frequency, phase = self.frequencies[piece], self.phases[piece]
        powers = self.coefficients.shape[-1]
        orders = []
        for k in range(4):
            value = jnp.zeros_like(u)
            for n in reversed(range(k, powers)):
                value = math.perm(n, k) * coefficients[..., n] + u * value
            turned = jnp.sin(frequency * u + phase + k * np.pi / 2)
            wave = self.amplitudes[piece] * frequency**k * turned
            orders.append((value + wave) / width**k)
        return jnp.stack(orders, axis=-1)


def _law(law) -> MotionLaw:
    if isinstance(law, MotionLaw):
        return law
    if law not in MOTION_LAWS:
        raise ValueError(
            f"There is no motion law {law!r}; choose one of {', '.join(MOTION_LAWS)}."
        )
    return MOTION_LAWS[law]


def _table(laws):
    """Tabulate the segment, start, polynomial and sine of each piece."""
    pieces = [(i, piece) for i, law in enumerate(laws) for piece in law.pieces]
    powers = max(len(piece.polynomial) for _, piece in pieces)
    owner = np.array([i for i, _ in pieces])
    ends = np.array([piece.end for _, piece in pieces])
    before = np.where(np.diff(owner, prepend=-1) == 0, np.roll(ends, 1), 0.0)
    coefficients = np.zeros((len(pieces), powers))
    for row, (_, piece) in zip(coefficients, pieces, strict=True):
        row[: len(piece.polynomial)] = piece.polynomial
    waves = np.array([(p.amplitude, p.frequency, p.phase) for _, p in pieces])
    return owner, before, jnp.asarray(coefficients), jnp.asarray(waves)
