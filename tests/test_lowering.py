"""What `jaxcam.hybrid.lowering` makes of functions, one by one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.hybrid.lowering import saving_jvp, scalarise, split


def _square(x):
    return x * x


@pytest.mark.parametrize("rule, opened", [(saving_jvp, True), (jax.custom_jvp, False)])
def test_only_a_rule_that_saves_work_is_taken_apart(rule, opened):
    """One of the reader's own is called as it is; values and derivatives stand."""
    square = rule(_square)
    square.defjvp(
        lambda primals, tangents: (square(*primals), 2 * primals[0] * tangents[0])
    )
    shape = jax.ShapeDtypeStruct((2,), jnp.float64)
    scalar = scalarise(square, shape)

    def called(x):
        return jnp.stack(list(scalar(split(x))))

    x = jnp.array([3.0, -0.5])
    names = [e.primitive.name for e in jax.make_jaxpr(called)(x).eqns]
    assert ("custom_jvp_call" not in names) == opened
    np.testing.assert_allclose(called(x), x**2, rtol=1e-15)
    np.testing.assert_allclose(jax.jacfwd(called)(x), np.diag(2 * x), rtol=1e-15)


def test_reverse_mode_of_products():
    """The gradient of (x . M x) by reverse mode; JAX rejected the products."""
    matrix = jnp.array([[2.0, 1.0], [0.5, 3.0]])
    scalar = scalarise(lambda x: x @ matrix @ x, jax.ShapeDtypeStruct((2,), float))
    x = jnp.array([0.3, -1.2])
    found = jax.grad(lambda x: scalar(split(x))[()])(x)
    np.testing.assert_allclose(found, (matrix + matrix.T) @ x, rtol=1e-14)
