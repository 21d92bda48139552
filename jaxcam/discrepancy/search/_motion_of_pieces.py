"""The motion of the pieces of a fit, as the terms of a model see it."""

import jax
import jax.numpy as jnp

from ...fitting.engine import (
    filtered_channels,
    runge_kutta,
    states_and_sides,
    with_begins,
)
from ...hybrid.programs import program
from ...hybrid.surface import OnSides
from ..terms import Motion


@program
def motion_of_pieces(layout, pieces, point) -> Motion:
    """Return the motion at the ends and the middle of every step of every piece."""

    def piece(model, state, start, step, drive, discrete):
        size = state.shape[0] - len(filtered_channels(model))
        known = None
        if discrete is not None:
            given = model, state, start, step, drive
            known = states_and_sides(*given, discrete)

        def advance(x, inputs):
            number, here, known = inputs
            t = start + (number + jnp.array([0.0, 0.5, 1.0])) * step
            during = free = model.during(t[1], here)
            if known is not None:
                x, negative = known
                during = lambda t: OnSides(free(t), negative)
            middle, _ = runge_kutta(model, during, t[0], x, step / 2)
            end, _ = runge_kutta(model, during, t[1], middle, step / 2)
            states = jnp.stack([x, middle, end])[:, :size]

            def motion(t, x):
                system = free(t)
                base = system.base
                if known is not None:
                    base = OnSides(base, known[1])
                return system.motion(t, x, field=base.vector_field(t, x))

            return end, jax.vmap(motion)(t, states)

        numbers = jnp.arange(drive.angle.shape[0], dtype=float)
        _, found = jax.lax.scan(advance, state, (numbers, drive, known))

        def in_order(part):
            inner = part[:, :2].reshape(-1, *part.shape[2:])
            return jnp.concatenate([inner, part[-1:, 2]])

        return jax.tree.map(in_order, found)

    def record(pieces, values, states):
        model = layout.at(values)
        part = pieces.flown
        inputs = states, part.start, part.step, pieces.drive, pieces.begins
        return jax.vmap(lambda *one: piece(model, *one))(*inputs)

    return jax.vmap(record)(with_begins(pieces, point), point.values, point.states)
