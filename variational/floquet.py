"""Multipliers of a periodic orbit, and the functions whose zeros are bifurcations."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxcam.hybrid import HybridSystem, Settings
from jaxcam.hybrid.surface import normal_acceleration, normal_velocity
from jaxcam.parameters import as_arrays

from .orbits import by_product, eigenvalues, Method, Orbit, turn_derivative


class Stability(eqx.Module):
    """What the monodromy matrix of an orbit says about it."""

    multipliers: Complex[Array, " n"]
    """(n,) the largest modulus first."""
    vectors: Complex[Array, "n n"]
    """(n, n) a column for each multiplier."""
    fold: Float[Array, ""]
    """det(M - I), det(M + I) and the product of mu_i mu_j - 1 over i < j, each times
    `scale`: zero at a fold, a flip and a Neimark-Sacker bifurcation."""
    flip: Float[Array, ""]
    neimark_sacker: Float[Array, ""]
    scale: Float[Array, ""]
    """Between 0 and 1, vanishing with the slowest impact speed v as M grows like 1/v:
    the least of v / (v + |a| period), a the acceleration of the gap."""
    reason: str = eqx.field(static=True)
    """A sentence where some multipliers must be zero, else the empty string."""

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle."""
        return bool(jnp.all(jnp.abs(self.multipliers) < 1))


def floquet_multipliers(
    system: HybridSystem,
    orbit: Orbit,
    *,
    method: Method = "product",
    settings: Settings | None = None,
) -> Complex[Array, " n"]:
    """Floquet multipliers of a periodic orbit, the largest modulus first.

    **Arguments:** as for [`variational.monodromy`][].

    Returns:
        Shape `(n,)`, complex. Zero where the orbit sticks: contact fixes gap and normal
            velocity, whatever they were.
    """
    if method == "product":
        return _multipliers(as_arrays(system), orbit.state, orbit.pieces, orbit.sticks)
    made = turn_derivative(system, orbit, method=method, settings=settings)
    return eigenvalues(made.state, made.determinant)


@eqx.filter_jit
def _multipliers(system, state, pieces, sticks):
    made = by_product(system, jnp.zeros(0), None, state, pieces, sticks)
    return eigenvalues(made.state, made.determinant)


def stability(system: HybridSystem, orbit: Orbit) -> Stability:
    """Multipliers, eigenvectors and test functions of a periodic orbit.

    The test functions are formed from the multipliers (Kuznetsov, Elements of Applied
    Bifurcation Theory, section 10.2) and multiplied by the impact speed, so that they
    stay bounded where an impact becomes a graze, and change sign only at a bifurcation.
    """
    system = as_arrays(system)
    made = turn_derivative(system, orbit)
    multipliers = eigenvalues(made.state, made.determinant)
    scale = impact_scale(system, orbit)
    fold, flip, pairs = test_functions(multipliers)
    values, vectors = np.linalg.eig(np.asarray(made.state))
    order = np.argsort(-np.abs(values), kind="stable")
    return Stability(
        multipliers=multipliers,
        vectors=jnp.asarray(vectors[:, order], dtype=complex),
        fold=scale * fold,
        flip=scale * flip,
        neimark_sacker=scale * pairs,
        scale=scale,
        reason=_reason(orbit),
    )


def test_functions(
    multipliers: Complex[Array, " n"],
) -> tuple[Float[Array, ""], Float[Array, ""], Float[Array, ""]]:
    """det(M - I), det(M + I) and the product of mu_i mu_j - 1, from the multipliers."""
    i, j = np.triu_indices(multipliers.shape[0], k=1)
    return (
        jnp.prod(multipliers - 1).real,
        jnp.prod(multipliers + 1).real,
        jnp.prod(multipliers[i] * multipliers[j] - 1).real,
    )


# pytest would collect it
test_functions.__test__ = False  # pyright: ignore[reportFunctionMemberAccess]


def impact_scale(system: HybridSystem, orbit: Orbit) -> Float[Array, ""]:
    """The least of v / (v + |a| period) over the impacts that are no chatter; else 1.

    v is the speed of an impact and a the acceleration of the gap just before it, so
    that |a| period / v is about the largest entry of its saltation matrix.
    """
    count = int(orbit.impacts.count)
    if count == 0 or orbit.sticks:
        return jnp.ones(())
    return _scale(
        system,
        orbit.impacts.time[:count],
        orbit.impacts.before[:count],
        orbit.impacts.constraint[:count],
        orbit.period,
    )


@eqx.filter_jit
def _scale(system, times, states, sides, period):

    def one(t, x, side):
        speed = jnp.abs(normal_velocity(system, t, x)[side])
        pulled = jnp.abs(normal_acceleration(system, t, x)[side])
        return speed / (speed + pulled * period)

    return jnp.min(jax.vmap(one)(times, states, sides))


def _reason(orbit: Orbit) -> str:
    if not orbit.sticks:
        return ""
    n = orbit.state.shape[0]
    if n == 2:
        return (
            "All multipliers are zero because the orbit sticks: in contact gap and "
            "normal velocity are zero whatever they were, and two states have nothing "
            "else."
        )
    return (
        "At least two multipliers are zero because the orbit sticks: in contact gap "
        "and normal velocity are zero whatever they were."
    )
