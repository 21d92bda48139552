"""Measure the scale of a motion, to which its error and rounding are relative.

All measures are independent of units: it makes no difference whether a motion is given
in micrometres and milliseconds or in metres and seconds.
"""

import jax
import jax.numpy as jnp

from ._select import largest


# an error below this fraction of a component's scale is rounding
_ROUNDING = 1e-15
# allowed error, divided by the tolerance times the scale of the motion: a state of
# order one that moves by as much is then as accurate as if the tolerance were also its
# absolute error
_SHARE = 2.0
# first step relative to the time in which a component moves by its own scale
_FIRST = 0.125


def first_extents(lifts, left, jets, tinies, x) -> tuple[tuple, tuple]:
    """Return the origins of the components, and their scales before they have moved.

    A component on which a gap depends is measured from its start and has the scale of
    that gap, wherever the origin of its coordinate is; for any other component, the
    scale is its magnitude. With several gaps, the smallest scale counts. A gap that
    cannot be distinguished from zero (up to its value in `tinies`) counts as zero. A
    gap that is far from linear, so that more than itself would be `left` after the
    displacement that should close it, has no scale: its gradient may vanish.
    """
    origin, found = [], []
    for i, component in enumerate(x):
        own, least = jnp.abs(component), jnp.asarray(jnp.inf)
        for lift, rest, jet, tiny in zip(lifts, left, jets, tinies, strict=True):
            # the gradient is lift / |lift|^2
            square = sum(e * e for e in lift)
            height, share = jnp.abs(jet.gap), jnp.abs(lift[i])
            straight = (jnp.abs(rest) <= height) | (height <= tiny)
            height = jnp.where(height <= tiny, 0.0, height)
            seen = (share > 0) & straight
            # the component's share of the shortest path to the surface, and the length
            # of the path along which only this component changes
            alone = height * square / jnp.where(seen, share, 1.0)
            near = jnp.clip(own, height * share, jnp.where(seen, alone, jnp.inf))
            least = jnp.minimum(least, jnp.where(seen, near, jnp.inf))
        seen = jnp.isfinite(least)
        found.append(jnp.where(seen, least, own))
        origin.append(jnp.where(seen, component, 0.0))
    stop_gradient = jax.lax.stop_gradient
    return tuple(map(stop_gradient, origin)), tuple(map(stop_gradient, found))


def scales(extents, before, after, pairs, h, per_run) -> tuple:
    """Return the scale of each component: the distance it has moved so far, or in the
    step.

    If a component is the rate of another (`pairs`: component to rate), its scale is at
    least the rate that would move the other component by its scale during the whole
    run, where `per_run` is the inverse of the length of the run (1/s). The scale of the
    other component is at least the distance that its rate covers in the step of length
    `h` (s), because the error of the rate acts over the same time.
    """
    found = [
        jnp.maximum(e, jnp.abs(b - a))
        for e, a, b in zip(extents, before, after, strict=True)
    ]
    for i, j in pairs.items():
        found[j] = jnp.maximum(found[j], found[i] * per_run)
        found[i] = found[i] + h * found[j]
    return tuple(found)


def held_scales(scale, carried, push, kicks, pairs, h) -> tuple:
    """Return the scales of a step in contact, where suppressed motion counts as motion.

    Bodies at rest under balanced forces move by the rounding of these forces, which is
    not a measure of the scale of their motion. `push` are the directions in which the
    multipliers (the accelerations of the jets) act, and `kicks` the changes of the
    field beyond the surfaces on which the motion slides; `pairs` is as in `scales`.
    """
    found = list(scale)
    for jet, held, direction in zip(carried.jets, carried.closed, push, strict=False):
        speed = jnp.where(held, h * jnp.abs(jet.acceleration), 0.0)
        for j, share in enumerate(direction):
            found[j] = jnp.maximum(found[j], speed * jnp.abs(share))
    for kick in kicks:
        for j, share in enumerate(kick):
            found[j] = jnp.maximum(found[j], h * jnp.abs(share))
    for i, j in pairs.items():
        found[i] = jnp.maximum(found[i], h * found[j])
    return tuple(map(jax.lax.stop_gradient, found))


def error_allowed(scale, before, after, tolerance, absolute) -> tuple:
    """Return the error that a step may have in each component; unless `absolute` is
    given, it is at least the rounding error.

    **Arguments:** scales, states at both ends, the relative tolerance, and the absolute
    error requested for each component, or `None` for a fraction of the scale.
    """
    sizes = [
        jnp.maximum(jnp.abs(a), jnp.abs(b)) for a, b in zip(before, after, strict=True)
    ]
    if absolute is not None:
        absolute = absolute * len(sizes) if len(absolute) == 1 else absolute
        return tuple(a + tolerance * s for a, s in zip(absolute, sizes, strict=True))
    return tuple(
        jnp.maximum(_SHARE * tolerance * w, _ROUNDING * s)
        for w, s in zip(scale, sizes, strict=True)
    )


def error_norm(error, allowed):
    """Return the largest error of a step relative to the allowed error."""
    return largest(
        [
            jnp.abs(e) / jnp.where(a > 0, a, 1.0)
            for e, a in zip(error, allowed, strict=True)
        ]
    )


def says_nothing(effort, tolerance):
    """Return whether the error estimate of a step with the error norm `effort` is only
    rounding.
    """
    return effort * tolerance <= _ROUNDING


def moved_extents(extents, origin, attempt) -> tuple:
    """Return the scales after an attempt: the largest distance of each component from
    its start.

    A component that has never moved takes its scale from the first attempt that moves
    it, whether accepted or not: relative to itself, the error of a motion such as t^9
    does not decrease with the step.
    """
    found = []
    for e, start, there, tried in zip(
        extents, origin, attempt.x, attempt.tried, strict=True
    ):
        new = jnp.maximum(e, jnp.abs(there - start))
        first = jnp.where(attempt.finite & (e == 0), tried, e)
        found.append(jax.lax.stop_gradient(jnp.where(attempt.good, new, first)))
    return tuple(found)


def first_step(extents, rates, t, longest):
    """Return the length of the first step from `t` (s): a fraction of the time scale.

    The time scale is the shortest time in which a component moves by its scale due to
    any of its first three `rates`; the step must also be long enough to change the
    time. (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.4,
    in dimensionless form)
    """
    length = longest
    for order, rate in enumerate(rates, start=1):
        for extent, r in zip(extents, rate, strict=True):
            counts = (extent > 0) & (r != 0)
            share = jnp.where(counts, extent, 1.0) / jnp.where(counts, jnp.abs(r), 1.0)
            time = _FIRST * share ** (1.0 / order)
            length = jnp.where(counts, jnp.minimum(length, time), length)
    length = jnp.minimum(jnp.maximum(length, 1e-13 * jnp.abs(t)), longest)
    return jax.lax.stop_gradient(length)
