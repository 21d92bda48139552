"""Compiled functions inside and outside of other compiled functions."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import programs
from jaxcam.hybrid.programs import _PASSED, is_tracing, program


TRACED: list[int] = []


@program
def _cube(x, power: int = 3):
    TRACED.append(power)
    return x**power


def test_a_program_is_traced_once_for_each_static_value():
    TRACED.clear()
    assert float(_cube(jnp.asarray(2.0))) == 8.0
    assert float(_cube(jnp.asarray(3.0))) == 27.0
    assert float(_cube(jnp.asarray(3.0), power=2)) == 9.0
    assert TRACED == [3, 2]


def test_what_was_passed_to_the_compiler_is_discarded():
    """The program is still compiled only once."""
    TRACED.clear()
    for start in (1.0, 2.0):
        _cube(jnp.full(5, start))
        assert not any(cache.cache_info().currsize for cache in _PASSED)
    assert TRACED == [3]


def test_a_program_may_be_called_inside_any_transformation():
    """JAX refuses compiler options inside another program; there, none are given."""
    x = jnp.asarray(2.0)
    assert float(jax.jit(lambda x: _cube(x) + 1)(x)) == 9.0
    # also without a traced argument
    assert float(jax.jit(lambda x: x + _cube(jnp.asarray(2.0)))(x)) == 10.0
    np.testing.assert_array_equal(jax.vmap(_cube)(jnp.arange(3.0)), [0.0, 1.0, 8.0])
    assert float(jax.grad(_cube)(x)) == 12.0
    assert float(jax.jit(jax.grad(_cube))(x)) == 12.0
    final, _ = jax.lax.scan(lambda c, _: (_cube(c), None), x, None, length=2)
    assert float(final) == 512.0
    assert float(eqx.filter_jit(_cube)(x)) == 8.0


@program
def _applied(function, x):
    return function(x)


def test_a_program_may_be_given_a_function_that_has_captured_a_traced_value():
    """Such a value is not among the arguments."""

    def product(r):
        return _applied(lambda x: r * x, jnp.asarray(3.0))

    for derivative in (jax.grad, jax.jacrev, jax.jacfwd):
        assert float(derivative(product)(2.0)) == 3.0
    assert float(jax.jit(jax.grad(product))(2.0)) == 3.0


def test_tracing_is_known():
    """True inside a program, false in eager derivatives and batches."""
    seen = []

    def look(x):
        seen.append(is_tracing())
        return 2.0 * x

    jax.jit(look)(1.0)
    jax.grad(look)(1.0)
    jax.vmap(look)(jnp.ones(2))
    look(1.0)
    assert seen == [True, False, False, False]


def test_a_version_of_xla_may_lack_an_option(monkeypatch):
    """The program then runs without options."""
    monkeypatch.setattr(programs, "_OPTIONS", {"xla_cpu_no_such_option": True})
    square = program(lambda x: x * x)
    assert [float(square(jnp.asarray(x))) for x in (3.0, 4.0)] == [9.0, 16.0]
