"""Take one step of any diffrax Runge-Kutta solver, explicit or implicit."""

import diffrax
import equinox as eqx
import jax.numpy as jnp
import optimistix as optx


def one_step(solver: diffrax.AbstractSolver, tolerance, field, t, x, h, scale):
    """One step of length `h` from `(t, x)` along `field(t, x)`.

    **Arguments:** the solver; the tolerance of the run, from which implicit solvers
    take that of their equations; time (s), state `(n,)` and length (s, zero allowed);
    the scale of each component, `(n,)`, positive.

    Returns:
        The state after the step and the estimate of its error, both `(n,)`.

    Raises:
        ValueError: The solver has no error estimate.
    """
    # time counts from t: t + h - t would lose the digits of a short step
    terms = scaled_term(field, t, x, scale)
    solver = _with_root_finder(solver, 1e-2 * tolerance)
    zero = jnp.zeros_like(h)
    start = jnp.zeros_like(x)
    state = solver.init(terms, zero, h, start, None)
    moved, error, _, _, _ = solver.step(
        terms, zero, h, start, None, state, made_jump=True
    )
    if error is None:
        raise ValueError(
            f"{type(solver).__name__} has no error estimate; pass an adaptive solver "
            "such as diffrax.Dopri8() or diffrax.Kvaerno5()"
        )
    still = h == 0
    after, error = x + scale * moved, scale * error
    return jnp.where(still, x, after), jnp.where(still, jnp.zeros_like(x), error)


def scaled_term(field, t, x, scale) -> diffrax.ODETerm:
    """Return the equation of motion of (state - x) / scale, `(n,)`, by the time after
    `t`.

    An absolute tolerance means the same for it in all units. Arguments of the equation
    are handed on to `field(t, x, *args)`.
    """

    def rate(s, y, args):
        arguments = () if args is None else (args,)
        return field(t + s, x + scale * y, *arguments) / scale

    return diffrax.ODETerm(rate)


def _with_root_finder(solver, tolerance):
    """Return the solver with a tolerance for its equations, as `diffeqsolve` would
    set it.
    """
    if not isinstance(solver, diffrax.AbstractImplicitSolver):
        return solver
    tolerance = jnp.maximum(tolerance, 1e-14)
    finder = diffrax.VeryChord(
        rtol=tolerance,  # pyright: ignore[reportArgumentType]
        atol=tolerance,  # pyright: ignore[reportArgumentType]
        norm=optx.max_norm,
    )
    return eqx.tree_at(lambda s: s.root_finder, solver, finder)
