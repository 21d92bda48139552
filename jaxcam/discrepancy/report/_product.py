"""Products of two forms: tables, derivatives and formulas."""

import math
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ...hybrid.programs import program
from ..search import Free, free_term
from ..terms import FreeFunction
from ._curves import errors_of, graded
from ._formula import formula_of


def product_table(
    one: Free, numbers: np.ndarray, covariance: np.ndarray, points: int
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray, np.ndarray]:
    """Return a grid of both arguments, and value and standard error of a product there,
    each `(points, points)`.

    **Arguments:** the product, its parameters and their covariance, and the number of
    points of each argument.
    """
    assert one.gate is not None
    term = free_term(one.family, one.slot, one.primitive, one.gate).exact()
    grid = []
    for side, family in enumerate((one.family, one.gate.family)):
        even = np.linspace(family.low, family.high, points)
        grid.append(
            graded(even, lambda x, side=side: _factors(term, one, numbers, x)[side])
        )
    value, slopes = _with_slopes(term, *grid, one.coefficients, numbers)
    error = errors_of(slopes.reshape(-1, len(numbers)), covariance)
    return (grid[0], grid[1]), value, error.reshape(value.shape)


def product_slopes(
    term: FreeFunction, names: Sequence[str], points: int
) -> Float[np.ndarray, "k p"]:
    """Return the derivatives of a product with respect to its parameters, on a grid
    over both ranges with about the given number of points.
    """
    gate, side = term.gate, math.isqrt(points)
    assert gate is not None
    grids = [np.linspace(float(f.low), float(f.high), side) for f in (term, gate)]
    numbers = [term.coefficients[k] for k in _indices(names)]
    slopes = _with_slopes(term, *grids, names, np.asarray(numbers))[1]
    return slopes.reshape(-1, len(names))


def product_of(one: Free, numbers: np.ndarray) -> tuple[str, str]:
    """Return the formula of a product, and a sentence about it."""
    assert one.gate is not None and one.primitive is not None
    count = one.primitive.count
    first, says = formula_of(one.family, one.primitive, numbers[:count], "force")
    own = np.append(1.0, numbers[count:])
    second, also = formula_of(one.gate.family, one.gate.primitive, own, "force")
    # both formulas begin with a coefficient, and the product has a single one
    (size, rest), (other, factor) = first.split("*", 1), second.split("*", 1)
    text = f"{float(size) * float(other):.4g}*{rest}*{factor}"
    acts, acts_too = (
        one_of.split(": ", 1)[0].removeprefix("a force that ")
        for one_of in (says, also)
    )
    return text, f"a force that {acts}, times a factor that {acts_too}: {text}"


def _indices(names: Sequence[str]) -> tuple[int, ...]:
    return tuple(int(name.rpartition("_")[2]) for name in names)


def _placed(term: FreeFunction, names: Sequence[str], numbers) -> FreeFunction:
    """Return a product with given parameters."""
    every = list(term.coefficients)
    for k, number in zip(_indices(names), numbers):
        every[k] = jnp.asarray(number)
    return eqx.tree_at(lambda f: f.coefficients, term, tuple(every)).prepared()


def _factors(term: FreeFunction, one: Free, numbers, at):
    """Return both forms of a product at the same values of their arguments."""
    ready = _placed(term, one.coefficients, numbers)
    return tuple(np.asarray(f.at(*_with_direction(f, at))) for f in (ready, ready.gate))


def _with_direction(form, at):
    return at, jnp.tanh(at / form.slip) * form.jumping


def _with_slopes(term, along, across, names: Sequence[str], numbers):
    """Return a product `(n, m)` and its derivatives `(n, m, p)`."""
    return tuple(map(np.asarray, _sloped(term, along, across, tuple(names), numbers)))


@program
def _sloped(term, along, across, names, numbers):
    def values(numbers):
        ready = _placed(term, names, numbers)
        one = jax.vmap(lambda x: ready.at(*_with_direction(ready, x)))(along)
        gate = ready.gate
        other = jax.vmap(lambda x: gate.at(*_with_direction(gate, x)))(across)
        return one[:, None] * other[None]

    return values(numbers), jax.jacfwd(values)(numbers)
