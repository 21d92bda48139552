"""All transformations of one case, checked against each other, in a process of its own.

    python tests/transformed.py simulate:faq-ball jit vmap grad

A process, because what is tested against is also that XLA ends it.
"""

import sys
from collections.abc import Callable

import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from transformed_cases import Case, case_of


jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")

#: of numbers that are computed the same way, relative to the largest
SAME = 1e-11
#: of an independent path through the same numbers
NEAR = 1e-9
#: of central differences: step, and error relative to the largest
STEP, DIFFERENCE = 1e-5, 2e-5


def _close(found, expected, tolerance, what) -> None:
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape, (what, found.shape, expected.shape)
    assert np.all(np.isfinite(expected)), (what, expected)
    size = np.max(np.abs(expected))
    error = np.max(np.abs(found - expected))
    assert error <= tolerance * max(size, 1e-3), (what, error, size, found, expected)


class Checks:
    """One check for each transformation."""

    def __init__(self, case: Case):
        self.function, self.point = case.function, case.point
        self.untraced = case.untraced
        self.value = jax.jit(case.function)
        self.push = jax.jit(lambda p, v: jax.jvp(case.function, (p,), (v,)))
        # as much in each direction as the number itself
        self.along = jnp.asarray([1.0, -0.5]) * jnp.abs(self.point)
        self.weights = jnp.cos(jnp.arange(self.value(self.point).shape[0] * 1.0))

    def jit(self) -> None:
        if self.untraced is not None:
            _close(self.value(self.point), self.untraced(self.point), NEAR, "jit")
        else:
            _close(self.value(self.point), self.function(self.point), NEAR, "jit")

    def vmap(self) -> None:
        points = jnp.stack([self.point, self.point + 1e-3 * self.along])
        each = jnp.stack([self.value(p) for p in points])
        _close(jax.jit(jax.vmap(self.function))(points), each, NEAR, "vmap")

    def jvp(self) -> None:
        h = STEP * self.along
        ends = [self.value(self.point + side * h) for side in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * STEP)
        value, moved = self.push(self.point, self.along)
        _close(value, self.value(self.point), NEAR, "value of jvp")
        _close(moved, slope, DIFFERENCE, "jvp")

    def linearize(self) -> None:
        value, moved = self.push(self.point, self.along)
        found, linear = jax.linearize(self.function, self.point)
        _close(found, value, NEAR, "value of linearize")
        _close(linear(self.along), moved, SAME, "linearize")
        inside = jax.jit(lambda p, v: jax.linearize(self.function, p)[1](v))
        _close(inside(self.point, self.along), moved, SAME, "linearize in jit")

    def jacfwd(self) -> None:
        _, moved = self.push(self.point, self.along)
        matrix = jax.jit(jax.jacfwd(self.function))(self.point)
        _close(matrix @ self.along, moved, SAME, "jacfwd")

    def grad(self) -> None:
        _, moved = self.push(self.point, self.along)
        slope = jax.jit(jax.grad(self.total))(self.point)
        _close(slope @ self.along, self.weights @ moved, SAME * 10, "grad")

    def jacrev(self) -> None:
        _, moved = self.push(self.point, self.along)
        matrix = jax.jit(jax.jacrev(self.function))(self.point)
        _close(matrix @ self.along, moved, SAME, "jacrev")

    def hessian(self) -> None:
        matrix = jax.jit(jax.hessian(self.total))(self.point)
        h = STEP * self.along
        ends = []
        for side in (1, -1):
            _, moved = self.push(self.point + side * h, self.along)
            ends.append(self.weights @ moved)
        curve = (ends[0] - ends[1]) / (2 * STEP)
        _close(self.along @ matrix @ self.along, curve, 1e-4, "hessian")

    def least_squares(self) -> None:
        """The first number again from all that the function returns."""
        wanted, solver = self.value(self.point), optx.LevenbergMarquardt(1e-12, 1e-12)
        for options in ({}, {"jac": "bwd"}):
            made = optx.least_squares(
                lambda a, _: self.scaled(a) - wanted / self.size,
                solver,
                jnp.asarray(1.003),
                options=options,
                max_steps=256,
            )
            _close(made.value, 1.0, 1e-6, f"least_squares {options}")

    def root_find(self) -> None:
        """The same by Newton's method, from one number that depends on it most."""
        _, moved = self.push(self.point, self.point * jnp.asarray([1.0, 0.0]))
        best = int(jnp.argmax(jnp.abs(moved)))
        wanted, size = self.value(self.point)[best], jnp.abs(moved[best])

        def miss(a, _):
            return (self.function(self.moved(a))[best] - wanted) / size

        solver = optx.Newton(1e-10, 1e-10, linear_solver=lx.AutoLinearSolver(None))
        made = optx.root_find(miss, solver, jnp.asarray(1.001), max_steps=32)
        _close(made.value, 1.0, 1e-7, "root_find")

    @property
    def size(self):
        return jnp.max(jnp.abs(self.value(self.point)))

    def moved(self, factor):
        return self.point * jnp.stack([factor, jnp.ones_like(factor)])

    def scaled(self, factor):
        return self.function(self.moved(factor)) / self.size

    def total(self, p):
        return self.weights @ self.function(p)


ALL = (
    "jit",
    "vmap",
    "jvp",
    "linearize",
    "grad",
    "jacfwd",
    "jacrev",
    "hessian",
    "least_squares",
    "root_find",
)


def main(group: str, *names: str) -> None:
    checks = Checks(case_of(group))
    for name in names or ALL:
        check: Callable[[], None] = getattr(checks, name)
        check()
        print(name, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
