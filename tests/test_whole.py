"""A loop that is one operation of JAX: its derivatives, and the kernel it compiles to.

A loop of three rounds is compared with the same rounds written out, within 1e-13.
"""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.hybrid.lowering._one_kernel import one_kernel
from jaxcam.hybrid.lowering._whole import while_loop, whole


POINT = jnp.array([0.7, 1.1])


def turned(x, p):
    return x * jnp.sin(p[1] + x)


def looped(p):
    def body(carry):
        x, count = carry
        return turned(x, p), count + 1

    x, _ = while_loop(lambda carry: carry[1] < 3, body, (p[0], 0))
    return jnp.stack([x, p[0] * p[1]])


def written_out(p):
    return jnp.stack([turned(turned(turned(p[0], p), p), p), p[0] * p[1]])


def summed(f):
    return lambda p: jnp.sum(jnp.sin(f(p)))


def scanned(f):
    def step(carry, _):
        return carry + jnp.sum(f(POINT * (1 + 0.1 * carry))), None

    return lambda p: jax.lax.scan(step, p[0] * p[1], None, length=3)[0]


def branched(f):
    return lambda p: jax.lax.cond(p[0] > 0.5, lambda: jnp.sum(f(p)), lambda: p[1])


def batched(f):
    return lambda p: jnp.sum(jax.vmap(f, in_axes=1)(jnp.stack([p, 2 * p], axis=1)))


def saved(f):
    return summed(jax.checkpoint(lambda p: f(jnp.sin(f(p)))))


TRANSFORMED = {
    "value": lambda f: f(POINT),
    "jacfwd": lambda f: jax.jacfwd(f)(POINT),
    "jacrev": lambda f: jax.jacrev(f)(POINT),
    "linearize": lambda f: jax.linearize(f, POINT)[1](POINT),
    "linear transpose": lambda f: jax.vjp(f, POINT)[1](POINT)[0],
    "hessian": lambda f: jax.hessian(summed(f))(POINT),
    "forward twice": lambda f: jax.jacfwd(jax.jacfwd(f))(POINT),
    "backward twice": lambda f: jax.jacrev(jax.jacrev(f))(POINT),
    "third": lambda f: jax.jacfwd(jax.hessian(summed(f)))(POINT),
    "grad of scan": lambda f: jax.grad(scanned(f))(POINT),
    "linearize scan": lambda f: jax.linearize(scanned(f), POINT)[1](POINT),
    "hessian of cond": lambda f: jax.hessian(branched(f))(POINT),
    "hessian of vmap": lambda f: jax.hessian(batched(f))(POINT),
    "vmap of grad": lambda f: jax.vmap(jax.grad(summed(f)))(jnp.eye(2) + 0.3),
    "grad of checkpoint": lambda f: jax.grad(saved(f))(POINT),
    "hessian of checkpoint": lambda f: jax.hessian(saved(f))(POINT),
}


@pytest.mark.parametrize("transform", TRANSFORMED.values(), ids=TRANSFORMED)
@pytest.mark.parametrize("compiled", [False, True], ids=["as it is", "compiled"])
def test_a_loop_is_differentiated_like_its_rounds(transform, compiled):
    wrap = jax.jit if compiled else lambda f: f
    found = np.asarray(wrap(lambda: transform(looped))())
    expected = np.asarray(transform(written_out))
    assert found.shape == expected.shape
    assert np.max(np.abs(found - expected)) <= 1e-13 * max(np.max(np.abs(expected)), 1)


def test_a_result_that_does_not_count_may_move_infinitely():
    """sqrt at zero has an infinite slope; it is no part of the sum."""

    @whole
    def roots(x):
        return jnp.sqrt(x), 3 * x

    assert float(jax.grad(lambda x: roots(x)[1])(0.0)) == 3.0
    # a cotangent that is zero, but not known to be
    masked = jax.grad(lambda x: jnp.sum(jnp.stack(roots(x)) * jnp.array([0.0, 1.0])))
    assert float(masked(0.0)) == 3.0


def test_what_is_not_an_array_passes_through():
    made = whole(lambda p: {"twice": 2 * p, "name": "p", "positive": p > 0})(POINT)
    assert made["name"] == "p"
    assert made["positive"].dtype == bool
    np.testing.assert_array_equal(made["twice"], 2 * POINT)


# each ends the process where an argument of a kernel may lose its last use
_KERNELS = {
    "never used": "lambda p: jnp.zeros(())",
    "used in vain": "lambda p: jnp.where(jnp.zeros((), bool), p[0], p[1])",
    "left out": "lambda p: jax.lax.while_loop(lambda c: c[0] < 9, body, p)[0]",
    "linearised": "lambda p: jax.lax.while_loop(lambda c: c[0] < 9, body, p)",
}
_PROGRAM = """
import jax, jax.numpy as jnp, jaxcam
from jaxcam.hybrid.lowering._one_kernel import one_kernel
body = lambda c: (c[0] + 1, c[1] * c[2], c[2])
p = tuple(jnp.array([1.0, 2.0, 3.0]))
kernel = one_kernel({kernel})
value, linear = jax.linearize(lambda p: kernel(p), p)
print(jax.tree.leaves(kernel(p))[0], jax.tree.leaves(jax.jit(kernel)(p))[0])
print(jax.tree.leaves(value)[0], jax.tree.leaves(linear(p))[0])
"""


@pytest.mark.parametrize("kernel", _KERNELS.values(), ids=_KERNELS)
def test_xla_compiles_a_kernel_whatever_of_it_is_needed(kernel):
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM.format(kernel=kernel)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    first = {"never used": "0.0", "used in vain": "2.0"}
    name = next(n for n, k in _KERNELS.items() if k == kernel)
    said = first.get(name, "9.0")
    assert done.stdout.split()[:3] == [said] * 3


@pytest.mark.parametrize(
    "function",
    [
        jnp.sort,
        jnp.median,
        lambda p: p.at[jnp.array([3, 1])].add(p[:2]),
        lambda p: (jnp.outer(p, p) @ jnp.outer(p, p))[0],
        lambda p: jax.lax.top_k(p, 2)[0],
        lambda p: jnp.linalg.solve(jnp.eye(8) + jnp.outer(p, p), p),
    ],
    ids=["sort", "median", "scatter", "matrices", "top_k", "solve"],
)
def test_what_the_backend_cannot_write_into_a_kernel(function):
    """It is compiled as it is, with the same results."""
    p = jnp.cos(jnp.arange(8.0))
    found = jax.jit(one_kernel(function))(p)
    np.testing.assert_allclose(found, function(p), rtol=1e-12, atol=1e-14)
