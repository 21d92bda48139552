"""Choose the accuracy of the joints between pieces from the drive and the samples."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ...hybrid.programs import program
from ._extras import Extras, Sharpness
from ._fly import fly
from ._layout import Layout
from ._linearise import assemble, Point, with_begins
from ._model import augmented_field, DriveState, filtered_channels
from ._pieces import IMPACT, Pieces
from ._predict import after_impact, smallest_gap


# Standard error of a joint within a flight, relative to that of the state from the
# samples
JOINT = 1e-3
# Standard error of an impact joint, relative to those of the flights on both sides: it
# adds a negligible tenth to their variance, and removes the effects of chaos and of
# small model errors
_IMPACT = 10**-0.5
# Relative information added to combinations that the samples do not determine
_BLIND = 1e-12
# Error of a joint, relative to that of a single piece, above which it counts as loose
_LOOSE = 0.1
_WIDTH = 4
# Number of columns up to which a program has a column for every parameter; beyond it,
# the width is the number of free parameters, rounded up to a multiple of the second
# number
_MANY, _STRIDE = 64, 32
# Number of steps of a piece up to which one program is used for states and parameters
_FEW_STEPS = 20


def width_of(number: int) -> int:
    """Return the number of columns of a compiled program: a multiple of four, so that
    similar fits share a program.
    """
    return _WIDTH * max(1, -(-number // _WIDTH))


def shared_width(free: int, most: int) -> int:
    """Return the number of columns of a program for a subset of the parameters.

    With few parameters in total (`most`), there is a column for each of them, so that
    one program serves every subset; otherwise, the number of free parameters is rounded
    up to a multiple of 32.
    """
    whole = width_of(most)
    return whole if whole <= _MANY else min(whole, _STRIDE * -(-free // _STRIDE))


def joint_sharpness(layout: Layout, pieces: Pieces, point: Point, guess) -> Extras:
    """Return the standard errors of the joints, from the drive and the samples."""
    # with NumPy, because JAX would compile each operation for each number of recordings
    records, width = pieces.joint.shape
    size = point.states.shape[-1]
    one, apart = np.ones((records, width, size)), np.full(records, 1 / JOINT)

    def extras(flight, impact, gap, piece) -> Extras:
        sharpness = Sharpness(*map(jnp.asarray, (flight, impact, gap, piece, apart)))
        weights = (np.asarray(a, float) for a in (pieces.exists, pieces.rest_exists))
        return Extras(jnp.asarray(guess), sharpness, *map(jnp.asarray, weights))

    joint = np.asarray(pieces.joint)
    alone = eqx.tree_at(lambda p: p.joint, pieces, np.zeros_like(joint))
    blocks, _ = states_only(layout, alone, extras(one, one, one[..., 0], one), point)
    information = np.diagonal(np.asarray(blocks.ss), axis1=-2, axis2=-1)
    usual = np.array(
        [
            np.median(column[column > 0]) if np.any(column > 0) else np.nan
            for column in information.reshape(-1, size).T
        ]
    )
    # an unobserved state component is connected as tightly as the least observable one
    usual = np.where(np.isnan(usual), np.fmin.reduce(usual), usual)
    flight = np.broadcast_to(JOINT / np.sqrt(usual), one.shape)
    piece = flight / JOINT
    if np.any(np.asarray(pieces.drive_error.angle) > 0):
        # a component determined by the drive is known only as accurately as the drive
        by_drive = np.asarray(_drive_in_flight(layout, pieces, point))
        flight = np.sqrt(flight**2 + np.nan_to_num(by_drive) ** 2)
    sharp = extras(flight, flight, one[..., 0], piece)
    inner = np.where(joint == IMPACT, 0, joint)
    flights = eqx.tree_at(lambda p: p.joint, pieces, inner)
    blocks, _ = states_only(layout, flights, sharp, point)
    known = _IMPACT**2 * _variances(np.asarray(blocks.ss), np.asarray(blocks.before))
    before = np.concatenate([known[:, :1], known[:, :-1]], axis=1)
    known = np.minimum(known, before)
    slope, by_drive = map(np.asarray, _drive_slopes(layout, pieces, point))
    # padding may not be finite
    with np.errstate(over="ignore", invalid="ignore"):
        gap = np.sqrt(np.sum(slope**2 * known, axis=-1) + by_drive[..., -1] ** 2)
        impact = np.sqrt(known + by_drive[..., :-1] ** 2)
    return extras(flight, impact, gap, piece)


def states_only(layout: Layout, pieces: Pieces, extras: Extras, point: Point):
    """Return normal equations of the states, with all parameters held, and the
    costs.
    """
    # use the width of a fit of all parameters, so that one program serves both, unless
    # a sensor shows one of the parameters directly; for many steps, a separate narrow
    # program soon repays its compilation time
    few = pieces.steps <= _FEW_STEPS
    width = width_of(len(layout.places)) if few else _WIDTH
    none = jnp.zeros((pieces.joint.shape[0], width), dtype=int)
    scales = jnp.zeros(none.shape, dtype=float)
    return assemble(layout, pieces, extras, point, none, scales)


def loosened(extras: Extras) -> Extras:
    """Return joints within flights that are as loose as the samples of a piece allow.

    States estimated from the data are not continuous from piece to piece. In a flight
    of many pieces, closing all joints at once would predict the last piece from the
    first with inaccurate parameters.
    """
    sharpness = extras.sharpness
    return extras._replace(sharpness=sharpness._replace(flight=sharpness.piece))


def already_loose(extras: Extras) -> bool:
    """Return whether the joints within flights are nearly as loose as `loosened`
    makes them.
    """
    sharp = extras.sharpness
    return bool(np.all(np.asarray(sharp.flight) > _LOOSE * np.asarray(sharp.piece)))


def separated(extras: Extras) -> Extras:
    """Return joints that are so loose that each piece is fitted separately.

    A missing force acts in every piece, whereas its effect through impacts and other
    flights is strongly nonlinear.
    """
    sharp = extras.sharpness
    return extras._replace(
        sharpness=sharp._replace(
            flight=sharp.piece,
            impact=sharp.impact * sharp.apart[:, None, None],
            gap=sharp.gap * sharp.apart[:, None],
        )
    )


def allowing(extras: Extras, part: float) -> Extras:
    """Return joints whose errors are a given multiple of those of separate pieces.

    A model with errors cannot predict the initial state of a piece accurately from the
    end of the previous piece; `part` is the error of this prediction relative to that
    of the state of a single piece.
    """
    sharp, most = extras.sharpness, max(part, 1.0)
    looser = part * sharp.apart
    return extras._replace(
        sharpness=Sharpness(
            part * sharp.piece,
            looser[:, None, None] * sharp.impact,
            looser[:, None] * sharp.gap,
            most * sharp.piece,
            jnp.full_like(sharp.apart, most / part),
        )
    )


def _variances(ss, before):
    """Return the variance of each state as determined by the samples of its flight,
    shape `(r, k, n)`.
    """
    records, width, size, _ = ss.shape
    found = np.zeros((records, width, size))
    for r in range(records):
        matrix = np.zeros((width, size, width, size))
        for k in range(width):
            dead = np.diagonal(ss[r, k]) <= 0
            matrix[k, :, k] = ss[r, k] + np.diag(dead.astype(float))
            if k:
                matrix[k, :, k - 1] = before[r, k]
                matrix[k - 1, :, k] = before[r, k].T
        flat = matrix.reshape(width * size, -1)
        scale = 1 / np.sqrt(np.diagonal(flat))
        inverse = _inverse(flat * np.outer(scale, scale))
        found[r] = (np.diagonal(inverse) * scale**2).reshape(width, size)
    return np.abs(found)


def _inverse(matrix: Float[np.ndarray, "n n"]) -> Float[np.ndarray, "n n"]:
    """Return the inverse of an information matrix with a unit diagonal. A combination
    that the samples do not determine, such as a short flight behind a slow filter, has
    a large variance.
    """
    try:
        return np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return np.linalg.inv(matrix + _BLIND * np.eye(len(matrix)))


@program
def _drive_in_flight(layout: Layout, pieces: Pieces, point: Point):
    """Return the error of each piece's initial state, `(r, k, n)`, due to the noise of
    the drive during the previous piece, and to the acceleration of the drive.

    The noise of the encoder is independent from sample to sample; that of the smoothed
    angle, rate and acceleration is not. Integration by parts therefore expresses the
    effect of an error of the rate by that of an error of the angle; the terms at the
    ends of a piece cancel those of the neighbouring pieces.
    """

    def one(values, states, pieces):
        model, error, part = layout.at(values), pieces.drive_error, pieces.flown

        def spread(state, start, step, drive, begin):
            def end(drive):
                return fly(model, state, start, step, drive, discrete=begin)[0]

            angle, rate, acceleration = jax.jacfwd(end)(drive)
            weights = angle - jnp.gradient(rate, axis=-1) / step
            noise = error.mean**2 * jnp.sum(weights**2, axis=-1) / step
            if model.sees_acceleration:
                lasting = error.acceleration * jnp.sum(acceleration, axis=-1)
            else:
                lasting = error.unsteadiness * jnp.sum(rate, axis=-1)
            return jnp.sqrt(noise + lasting**2)

        inputs = states, part.start, part.step, pieces.drive, pieces.begins
        found = jax.vmap(spread)(*inputs)
        return jnp.concatenate([found[:1], found[:-1]])

    arrays = jax.tree.map(jnp.asarray, with_begins(pieces, point))
    return jax.vmap(one)(point.values, point.states, arrays)


@program
def _drive_slopes(layout: Layout, pieces: Pieces, point: Point):
    """Return the derivatives of the gap with respect to the state, `(r, k, n)`, and the
    errors of an impact due to the drive.
    """

    def one(values, state, t, drive, error):
        model = layout.at(values)
        size = state.shape[0] - len(filtered_channels(model))

        def by_rate(x):
            def field(rate):
                system = model.driven(t, drive._replace(rate=rate))
                return augmented_field(model, system, t, x)

            return jax.jacfwd(field)(drive.rate)

        def landed(off):
            # the integrated noise of the rate shifts the state in flight
            x = state + by_rate(state) * off[2]
            shifted = drive.angle + off[0], drive.rate + off[1], drive.acceleration
            system = model.driven(t, DriveState(*shifted))
            gap = smallest_gap(system, t, x[:size])
            after = jnp.concatenate([after_impact(system, t, x[:size]), x[size:]])
            after = after - by_rate(after) * off[2]
            return jnp.concatenate([after, gap[None]])

        def gap_of(x):
            system = model.driven(t, drive)
            return smallest_gap(system, t, x[:size])

        jacobian = jax.jacfwd(landed)(jnp.zeros(3))
        errors = jnp.stack([error.angle, error.rate, error.turned])
        spread = jnp.sqrt(jacobian**2 @ errors**2)
        return jax.grad(gap_of)(state), spread

    along = jax.vmap(one, in_axes=(None, 0, 0, 0, None))
    return jax.vmap(along)(
        point.values,
        point.states,
        jnp.asarray(pieces.flown.start),
        *jax.tree.map(jnp.asarray, (pieces.drive_at, pieces.drive_error)),
    )
