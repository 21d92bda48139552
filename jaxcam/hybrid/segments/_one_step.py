"""Take one step of any diffrax Runge-Kutta solver, explicit or implicit."""

import diffrax
import equinox as eqx
import jax.numpy as jnp
import optimistix as optx


def one_step(solver: diffrax.AbstractSolver, tolerance, field, t, x, h, scale):
    """Take one step of length `h` from `(t, x)` along `field(t, x)`.

    **Arguments:** the solver; the tolerance of the run, from which implicit solvers
    derive the tolerance of their equations; time (s), state `(n,)` and step length (s,
    may be zero); the scale of each component, `(n,)`, positive.

    Returns:
        The state after the step and its error estimate, both `(n,)`.

    Raises:
        ValueError: The solver has no error estimate.
    """
    # time is measured from t, because t + h - t would lose the digits of a short step
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
    """Return the equation of motion of (state - x) / scale, `(n,)`, in the time after
    `t`.

    An absolute tolerance then has the same meaning in all units. Arguments of the
    equation are passed on to `field(t, x, *args)`.
    """

    def rate(s, y, args):
        arguments = () if args is None else (args,)
        return field(t + s, x + scale * y, *arguments) / scale

    return diffrax.ODETerm(rate)


def _with_root_finder(solver, tolerance):
    """Return the solver with the tolerance for its equations that `diffeqsolve` would
    set.
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
