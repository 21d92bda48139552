"""Find the parameter value at which complete chatter ends at the release point.

The orbit that sticks once per period starts each period at release with zero relative
velocity, so its interruption is given by one scalar equation, accumulation = release +
period. This equation is not smooth (the difference of its sides falls like a power
between 1/2 and 1), so its smooth form `ChatterOrbit.margin` is solved, by Newton's
method within a bracket.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, Int

from jaxcam import HybridSystem
from jaxcam.hybrid.programs import program
from jaxcam.parameters import as_arrays, pick, unit_tangent, Where

from ._chatter_orbit import prepared_orbit
from ._scalar import check_chatter_system


_ITERATIONS = 200


class Line(eqx.Module):
    """A one-parameter family of systems, `base` + value x `direction`.

    In `base`, the parameter is zero; in `direction`, it is one, and all other data are
    zero. The family is a pytree, so one compiled program serves all parameters.
    """

    base: HybridSystem
    direction: HybridSystem

    def at(self, value) -> HybridSystem:
        arrays, rest = eqx.partition(self.base, eqx.is_inexact_array)
        moved = jax.tree.map(lambda b, d: b + value * d, arrays, self.direction)
        return eqx.combine(moved, rest)


def line(system: HybridSystem, where: Where) -> Line:
    """Return the systems that differ from `system` in the parameter selected by
    `where`.
    """
    system = as_arrays(system)
    picked = pick(where, system)
    return Line(
        base=picked.replaced(system, jnp.zeros_like(picked(system))),
        direction=unit_tangent(picked, system),
    )


class Interruption(eqx.Module):
    """The parameter value at which complete chatter ends at the release point."""

    value: Float[Array, ""]
    """The parameter, in its own unit."""
    converged: Bool[Array, ""]
    """Whether the bracket was reduced to rounding error."""
    ends: Float[Array, "2"]
    """Margin of [`variational.chatter_accumulation`][] at both ends of the bracket,
    shape `(2,)`: negative where chatter is complete, positive where it is interrupted.
    """
    slope: Float[Array, ""]
    """Derivative of the margin with respect to the parameter at `value`."""
    turns: Int[Array, ""]
    """Number of evaluations of the margin."""


def interruption_in(
    system: HybridSystem, where: Where, low, high, periods: int = 1
) -> Interruption:
    """Find the interruption of chatter between two values of a parameter.

    This function is for use inside `jit`. A safeguarded Newton's method finds the zero
    of the margin of [`variational.chatter_accumulation`][]. The result can be
    differentiated in forward mode with respect to every other parameter of the system
    (implicit function theorem). No error is raised; `converged` is false if the margin
    does not change sign.

    Args:
        system: A system with two states, one constraint and a period.
        where: Selects the parameter.
        low: Lower end of the bracket.
        high: Upper end of the bracket.
        periods: Number of forcing periods in one period of the orbit.

    Returns:
        An [`variational.chatter.Interruption`][].

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational.chatter import interruption_in
        >>> system = ImpactOscillator(omega=1.0, restitution=0.5)
        >>> found = interruption_in(system, "omega", 0.4, 0.8)
        >>> bool(found.converged), round(float(found.value), 4)
        (True, 0.6072)
    """
    low, high = jnp.asarray(low, jnp.float64), jnp.asarray(high, jnp.float64)
    return _solve(line(system, where), low, high, periods=periods)


def _margin(along: Line, value, periods: int):
    """Return the margin; a motion without a margin (NaN) counts as interrupted."""
    orbit = prepared_orbit(along.at(value).prepared(), 0.0, periods)
    return jnp.where(jnp.isnan(orbit.margin), jnp.inf, orbit.margin)


def _slope(along: Line, value, periods: int):
    """Return the margin and its derivative with respect to the parameter."""

    def margin(value):
        return _margin(along, value, periods)

    return jax.jvp(margin, (value,), (jnp.ones_like(value),))


@eqx.filter_custom_jvp
def _solve(along: Line, low, high, *, periods: int) -> Interruption:
    return _search(along, low, high, periods)


@_solve.def_jvp
def _solve_jvp(primals, tangents, *, periods: int):
    """Apply the implicit function theorem: margin(value, parameters) remains zero."""
    along, low, high = primals
    moved, _, _ = tangents
    found = _solve(along, low, high, periods=periods)
    rate = _rate(along, moved, found.value, periods)
    zeros = jax.tree.map(_no_tangent, found)
    by_value = jnp.where(found.converged, -rate / found.slope, jnp.nan)
    return found, eqx.tree_at(lambda f: f.value, zeros, by_value, is_leaf=_is_none)


def _is_none(leaf):
    return leaf is None


def _no_tangent(leaf):
    return jnp.zeros_like(leaf) if eqx.is_inexact_array(leaf) else None


@program
def _rate(along: Line, moved: Line, value, periods: int):
    """Return the change of the margin due to `moved`, at a fixed parameter value."""
    return eqx.filter_jvp(lambda a: _margin(a, value, periods), (along,), (moved,))[1]


@program
def _search(along: Line, low, high, periods: int) -> Interruption:
    """Apply Newton's method, and bisection where it leaves the bracket or converges
    slowly.
    """

    def look(carry):
        points, signs, value, step, ends, _, count, _ = carry
        margin, slope = _slope(along, value, periods)
        # the first two evaluations are those at the ends
        at_end = jnp.arange(2) == count
        ends = jnp.where(at_end, margin, ends)
        signs = jnp.where(at_end, jnp.sign(margin), signs)
        inner = count >= 2
        points = jnp.where(inner & (jnp.sign(margin) == signs), value, points)
        lower, upper = jnp.min(points), jnp.max(points)
        newton = value - margin / jnp.where(slope == 0, jnp.nan, slope)
        good = (newton > lower) & (newton < upper)
        good &= inner & (jnp.abs(newton - value) < 0.5 * step)
        moved = jnp.where(good, newton, 0.5 * (lower + upper))
        size = jnp.abs(moved - value)
        close = inner & (size <= 2e-16 * jnp.abs(moved))
        narrow = inner & (upper - lower <= 4e-16 * jnp.abs(upper))
        hopeless = (count == 1) & ~(signs[0] * signs[1] < 0)
        stays = close | narrow | hopeless
        moved = jnp.where(count == 0, points[1], jnp.where(stays, value, moved))
        step = jnp.where(inner, size, jnp.abs(points[1] - points[0]))
        return points, signs, moved, step, ends, slope, count + 1, stays

    def unsolved(carry):
        return ~carry[7] & (carry[6] < _ITERATIONS)

    points, nothing = jnp.stack([low, high]), jnp.full(2, jnp.nan)
    start = (points, nothing, low, high - low, nothing, jnp.nan * low, 0, False)
    _, signs, value, _, ends, slope, count, done = jax.lax.while_loop(
        unsolved, look, jax.tree.map(jnp.asarray, start)
    )
    return Interruption(
        value=value,
        converged=done & (signs[0] * signs[1] < 0),
        ends=ends,
        slope=slope,
        turns=count,
    )


def chatter_interruption(
    system: HybridSystem,
    where: Where,
    bracket: tuple[float, float],
    periods: int = 1,
) -> Float[Array, ""]:
    """Find the parameter value at which complete chatter ends at the release point.

    There, the impacts of the orbit that sticks once in `periods` forcing periods
    accumulate exactly at release. On one side, the orbit is periodic and sticks; on the
    other side, it no longer sticks, and the map over one period has infinitely many
    lobes, with periodic windows and chaos (thesis, section 5.4 and chapter 6).

    Args:
        system: A system with two states, one constraint and a period.
        where: Selects the parameter: `lambda system: system.speed`, or `"speed"`.
        bracket: Two values of the parameter, with complete chatter at one and
            interrupted chatter at the other. With several periods, both should be close
            to the interruption: elsewhere, contact may occur in an earlier period, and
            the chatter then also counts as interrupted.
        periods: Number of forcing periods in one period of the orbit.

    Returns:
        The value, in the unit of the parameter; it can be differentiated in forward
            mode with respect to the other parameters.

    Raises:
        ValueError: The bracket contains no interruption (checked only outside
            transformations).

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import chatter_interruption
        >>> system = ImpactOscillator(omega=1.0, restitution=0.5)
        >>> round(float(chatter_interruption(system, "omega", (0.4, 0.8))), 4)
        0.6072
    """
    check_chatter_system(system)
    low, high = bracket
    found = interruption_in(system, where, low, high, periods)
    if not isinstance(found.converged, Tracer):
        _require(found, low, high)
    return found.value


def _require(found: Interruption, low, high) -> None:
    if bool(np.all(found.converged)):
        return
    ends = np.asarray(found.ends)
    if np.all(ends < 0):
        state = "chatter is complete at both ends"
    elif np.all(ends > 0):
        state = "chatter is interrupted, or does not occur, at both ends"
    else:
        state = "there is no release from sticking in it"
    raise ValueError(
        f"No interruption of chatter between {float(low):g} and {float(high):g}: "
        f"{state}. Give a bracket with complete chatter at only one end."
    )
