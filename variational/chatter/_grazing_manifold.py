"""Compute pre-images and images of grazing impacts, and the chatter region."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam import HybridSystem
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import contact_acceleration
from jaxcam.parameters import as_arrays

from ._chatter_frame import prepared_frame
from ._impact_map import next_impact, surface_state
from ._reversed import Reversed
from ._scalar import check_chatter_system
from ._scaling_law import scaling_law


class ImpactCurve(eqx.Module):
    """Points in the plane of impact time and rebound speed; NaN where there is none."""

    time: Float[Array, "..."]
    """Times of the impacts (s)."""
    speed: Float[Array, "..."]
    """Rebound speeds."""


class GrazingManifold(eqx.Module):
    """Impacts that lead to, or follow from, an impact of zero speed (thesis, eq.
    6.16).
    """

    grazing: Float[Array, " points"]
    """Times outside contact at which the motion grazes, shape `(points,)`."""
    before: ImpactCurve
    """S^1..S^n: S^k contains the impacts whose k-th successor grazes, shape `(n,
    points)` (thesis, eqs. 6.13 and 6.15).
    """
    after: ImpactCurve
    """W^1..W^n: W^k contains the k-th successors of grazing impacts, shape `(n,
    points)` (thesis, eqs. 6.14 and 6.15).
    """


def grazing_manifold(
    system: HybridSystem, n: int = 4, points: int = 200, horizon: float = 2.0
) -> GrazingManifold:
    """Return the pre-images S^k and images W^k, under the impact map, of the line of
    zero-speed impacts.

    The line contains only times outside the sticking set Z. At these times, contact
    cannot last: a motion that grazes leaves the constraint again (thesis, eqs.
    6.13-6.16).

    Args:
        system: A system with two states, one constraint, a period and a positive
            coefficient of restitution.
        n: Number of pre-images and of images.
        points: Number of points on the line.
        horizon: Longest flight, in periods.

    Returns:
        A [`variational.chatter.GrazingManifold`][]; times are not reduced modulo the
            period. A point of S^k whose flight would have started inside the constraint
            is NaN.

    Raises:
        ValueError: The system has no period.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import grazing_manifold
        >>> system = ImpactOscillator(omega=0.5, restitution=0.5)
        >>> grazing_manifold(system, n=1, points=8).before.time.shape
        (1, 8)
    """
    check_chatter_system(system)
    return _manifold(as_arrays(system).prepared(), n, points, horizon)


@program
def _manifold(system, n, points, horizon) -> GrazingManifold:
    grid = system.period * jnp.linspace(0.0, 1.0, 4 * points, endpoint=False)
    push = contact_acceleration(system, grid, jnp.zeros(2))
    # choose `points` times without contact, evenly spread over all such times
    order = jnp.argsort(push <= 0, stable=True)
    count = jnp.sum(push > 0)
    picks = order[(jnp.arange(points) * count) // points]
    times = jnp.where(count > 0, grid[picks], jnp.nan)
    backwards = Reversed(system)

    def chain(field, sense, time):
        state = surface_state(system, time, jnp.zeros(()))

        def hop(carry, _):
            s, x, speed, going = carry
            point = next_impact(field, s, x, speed, horizon * system.period)
            going = going & point.found
            # in reversed time, the approach speed is the rebound speed of the impact
            found = jnp.abs(point.approach) if sense < 0 else point.speed
            pair = jnp.stack([sense * point.time, found])
            carry = (point.time, point.state, point.speed, going)
            return carry, jnp.where(going, pair, jnp.nan)

        start = (sense * time, state, jnp.zeros(()), jnp.asarray(True))
        return jax.lax.scan(hop, start, length=n)[1]

    before = jax.vmap(lambda t: chain(backwards, -1.0, t), out_axes=1)(times)
    after = jax.vmap(lambda t: chain(system, 1.0, t), out_axes=1)(times)
    return GrazingManifold(
        grazing=times,
        before=ImpactCurve(before[..., 0], before[..., 1]),
        after=ImpactCurve(after[..., 0], after[..., 1]),
    )


def chattering_region(
    system: HybridSystem, points: int = 64, impacts: int = 16, near: float = 1e-3
) -> ImpactCurve:
    """Return the upper boundary of the region D in which chatter is complete.

    The boundary C consists of impacts whose sequence accumulates exactly at release.
    Close to release, it is the parabola v = lambda_bar c tau^2, with the rebound speed
    v, the time tau from release, the jerk c at release, and the fixed point lambda_bar
    of [`variational.scaling_law`][]. The boundary is invariant under the impact map,
    whose inverse extends it backwards in time (thesis, eqs. 6.20 and 6.91).

    Args:
        system: A system with two states, one constraint, a period and a positive
            coefficient of restitution.
        points: Number of points on each piece of the curve; a piece extends from an
            impact to the previous one.
        impacts: Number of pieces.
        near: Time before release, in periods, at which the parabola is used. The
            relative error of the parabola is of this order there, and the backward map
            reduces it.

    Returns:
        An [`variational.chatter.ImpactCurve`][], shape `(impacts * points,)`, ordered
            backwards in time from release; D lies between the curve and zero speed.

    Raises:
        ValueError: The system has no period.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import chattering_region
        >>> system = ImpactOscillator(omega=0.5, restitution=0.5)
        >>> chattering_region(system, points=8, impacts=2).speed.shape
        (16,)
    """
    check_chatter_system(system)
    return _boundary(as_arrays(system).prepared(), points, impacts, near)


@program
def _boundary(system, points, impacts, near) -> ImpactCurve:
    frame = prepared_frame(system, 0.0)
    law = scaling_law(frame.restitution)
    # a segment of the parabola; its first point is the next impact after its far end
    share = jnp.arange(points) / points
    tau = -near * system.period * law.p ** (1 - share)
    speed = law.lambda_bar * frame.jerk * tau * tau
    backwards = Reversed(system)

    def chain(tau, speed):
        time = frame.release + tau
        state = surface_state(system, time, speed)
        # in reversed time, the impact comes first, and changes the rebound speed to the
        # approach speed
        start = backwards.impact(-time, state)
        arrived = speed / frame.restitution

        def hop(carry, _):
            s, x, u, going = carry
            point = next_impact(backwards, s, x, u, system.period)
            going = going & point.found
            pair = jnp.stack([-point.time, -point.approach])
            found = jnp.where(going, pair, jnp.nan)
            return (point.time, point.state, point.speed, going), found

        begin = (-time, start, arrived, jnp.asarray(True))
        first = jnp.stack([time, speed])[None]
        rest = jax.lax.scan(hop, begin, length=impacts - 1)[1]
        return jnp.concatenate([first, rest])

    curve = jax.vmap(chain, out_axes=1)(tau, speed).reshape(-1, 2)
    return ImpactCurve(curve[:, 0], curve[:, 1])
