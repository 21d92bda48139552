"""Newton's method with one evaluation in its program."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.hybrid.newton import newton_at_once, newton_on_host


def circle(number: int = 2):
    """A circle and a line, or only the circle; and the calls while it is traced."""
    calls = []

    def evaluate(y):
        calls.append(1)

        def value(y):
            rows = jnp.stack([y @ y - 2.0, y[0] - y[1]])[:number]
            return rows, rows

        matrix, rows = jax.jacfwd(value, has_aux=True)(y)
        return rows, matrix, 3.0 * y

    return evaluate, calls


@pytest.mark.parametrize("number", [2, 1])
def test_a_root_is_found_with_one_evaluation_in_the_program(number):
    """(1, 1), or with the circle alone the nearest point in the limit, to 1e-12."""
    evaluate, calls = circle(number)

    @jax.jit
    def solve(y, given):
        return newton_at_once(evaluate, lambda _, f: f[:2], y, 1e-12, 20, given)

    start = jnp.array([1.5, 0.5 if number == 2 else 1.5])
    found = solve(start, False)
    assert len(calls) == 1
    assert found.success and 1 < found.iterations < 20
    np.testing.assert_allclose(found.y, [1.0, 1.0], atol=1e-12)
    # the results are those at the root itself
    np.testing.assert_array_equal(found.found[2], 3.0 * found.y)
    given = solve(start, True)
    np.testing.assert_array_equal(given.y, start)
    np.testing.assert_array_equal(given.found[2], 3.0 * start)
    assert given.iterations == 0


def test_a_singular_matrix_or_too_few_iterations_is_no_success():
    evaluate, _ = circle()

    def solve(start, most):
        y = jnp.asarray(start)
        return newton_at_once(evaluate, lambda _, f: f[:2], y, 1e-12, most, False)

    assert not solve([1.0, -1.0], 20).success
    assert not solve([1.5, 0.5], 2).success


@pytest.mark.parametrize("number", [2, 1])
def test_newtons_method_run_by_python_takes_the_same_steps(number):
    """Same iterates to 1e-14, same number of corrections; as for a given solution."""
    evaluate, _ = circle(number)
    start = jnp.array([1.5, 0.5 if number == 2 else 1.5])

    def on_host(y, iterations, given=False):
        return newton_on_host(
            lambda y: tuple(map(np.asarray, evaluate(jnp.asarray(y)))),
            lambda _, f: f[:2],
            np.asarray(y),
            1e-12,
            iterations,
            given,
        )

    for iterations in (2, 20):
        traced = newton_at_once(
            evaluate, lambda _, f: f[:2], start, 1e-12, iterations, False
        )
        found = on_host(start, iterations)
        np.testing.assert_allclose(found.y, traced.y, atol=1e-14)
        np.testing.assert_allclose(found.found[2], traced.found[2], atol=1e-14)
        assert found.success == bool(traced.success)
        assert found.iterations == int(traced.iterations)
    given = on_host(start, 20, given=True)
    np.testing.assert_array_equal(given.y, start)
    assert given.iterations == 0 and not given.success
    if number == 2:
        assert not on_host(np.array([1.0, -1.0]), 20).success
