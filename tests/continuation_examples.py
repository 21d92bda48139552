"""Small problems with known branches, shared by the tests of path following."""

import jax.numpy as jnp
import numpy as np

import continuation


def mu(parameters):
    return parameters["mu"]


def a(parameters):
    return parameters["a"]


def b(parameters):
    return parameters["b"]


def fold_field(u, p):
    return p["mu"] - u * u


def transcritical_field(u, p):
    return p["mu"] * u - u * u


def pitchfork_field(u, p):
    return p["mu"] * u - u**3


def hopf_field(u, p):
    """The Hopf normal form, omega = 2: x' = M x - x |x|^2."""
    turn = jnp.array([[0.0, -2.0], [2.0, 0.0]])
    return p["mu"] * u + turn @ u - u * jnp.sum(u * u)


def flip_map(u, p):
    """(2.16): x -> (1 + mu) x - x^3 with the multiplier at -1."""
    return -(1.0 + p["mu"]) * u + u**3


def logistic(u, p):
    return p["mu"] * u * (1.0 - u)


def cusp_field(u, p):
    return p["a"] + p["b"] * u + u**3


def henon(u, p):
    return jnp.stack([p["a"] - u[0] ** 2 - p["b"] * u[1], u[0]])


def circle(u, p):
    return u * u + p["mu"] ** 2 - 1.0


LOGISTIC = continuation.FixedPoint(logistic, {"mu": 2.0})
CUSP = continuation.Equilibrium(cusp_field, {"a": 2.0, "b": -1.0})


def cusp_start(b):
    """The only root of x^3 + b x + 2 for b > -3."""
    roots = np.roots([1.0, 0.0, b, 2.0])
    return [roots[np.argmin(np.abs(roots.imag))].real]
