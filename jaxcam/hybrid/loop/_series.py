"""Propagate the state over short times at an event by Taylor series."""

import jax
import jax.numpy as jnp


def taylor(x, rates, tau):
    """Return the state a time `tau` (s) after `x`, to third order in its `rates`."""
    first, second, third = rates
    return tuple(
        x[i] + tau * (first[i] + tau * (second[i] * 0.5 + tau * third[i] * (1 / 6)))
        for i in range(len(x))
    )


def taylor_of_release(functions, x, rates, frame, jets, tau, mode):
    """Return the state after sticking for the short time `tau` (s) that is left to the
    release, to second order.

    **Arguments:** the `rates`, the `frame` and the `jets` at `x`, and the mode. The
    rates of a planar system are those of free flight.
    """
    first, second, _ = rates
    if not functions.planar:
        return tuple(
            x[i] + tau * (first[i] + tau * second[i] / 2) for i in range(len(x))
        )
    # the sticking field is F - a D; because a is zero at the release, only the rate of
    # a contributes to the second derivative
    a, rate = jets[0].acceleration, jets[0].jerk
    push = frame.push[0]
    return tuple(
        jnp.where(
            mode[0],
            x[i]
            + tau * (first[i] - a * push[i] + tau * (second[i] - rate * push[i]) / 2),
            x[i],
        )
        for i in range(len(x))
    )


def off_rounding(frame, jets, x, hit, extents):
    """Return the state after an impact, and its jets, without the rounding error of the
    gap.

    This error would accumulate over the impacts of a chatter sequence, whose last
    flights are lower than the error. A gap that hardly depends on the state is left
    unchanged, because its correction would move the state far. The other gaps change as
    well, by more than their own rounding if the time is large and the constraint that
    was hit is moving.
    """
    jets = list(jets)
    for k, (direction, here) in enumerate(zip(frame.lift, hit, strict=False)):
        gap = jets[k].gap
        for a, b, extent in zip(x, direction, extents, strict=True):
            here = here & (jnp.abs(gap * b) <= 1e-6 * (jnp.abs(a) + extent))
        gap = jax.lax.stop_gradient(jnp.where(here, gap, 0.0))
        x = tuple(a - gap * b for a, b in zip(x, direction, strict=True))
        for i, other in enumerate(frame.lift):
            if i != k:
                # the gradient is lift / |lift|^2
                square = sum(b * b for b in other)
                share = sum(a * b for a, b in zip(other, direction, strict=True))
                moved = jets[i].gap - gap * share / square
                jets[i] = jets[i]._replace(gap=moved)
    return x, tuple(jets)
