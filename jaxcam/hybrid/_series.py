"""The state over the short times at an event, by Taylor series."""

import jax
import jax.numpy as jnp


def taylor(x, rates, tau):
    """The state a time `tau` (s) after `x`, to third order, by its `rates`."""
    first, second, third = rates
    return tuple(
        x[i] + tau * (first[i] + tau * (second[i] * 0.5 + tau * third[i] * (1 / 6)))
        for i in range(len(x))
    )


def taylor_of_release(functions, x, rates, frame, jets, tau, contact):
    """The sticking motion over the short time `tau` (s) to release, to second order.

    `rates` of the free flight from `x`, its `frame` and `jets`, and what is in contact.
    """
    first, second, _ = rates
    if not functions.planar:
        return tuple(
            x[i] + tau * (first[i] + tau * second[i] / 2) for i in range(len(x))
        )
    # F_s = F - a D: with a = 0 at release only its rate remains
    a, rate = jets[0].acceleration, jets[0].jerk
    push = frame.push[0]
    return tuple(
        jnp.where(
            contact[0],
            x[i]
            + tau * (first[i] - a * push[i] + tau * (second[i] - rate * push[i]) / 2),
            x[i],
        )
        for i in range(len(x))
    )


def off_rounding(frame, jets, x, hit):
    """The state after an impact without the gap that rounding left it.

    It would add up over the impacts of a chatter, whose last hops are lower than it.
    """
    for direction, jet, here in zip(frame.lift, jets, hit, strict=True):
        gap = jax.lax.stop_gradient(jnp.where(here, jet.gap, 0.0))
        x = tuple(a - gap * b for a, b in zip(x, direction, strict=True))
    return x
