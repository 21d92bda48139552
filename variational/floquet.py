"""Compute the multipliers of a periodic orbit, and test functions for bifurcations."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxcam.hybrid import HybridSystem, Settings, SwitchedSystem
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import normal_acceleration, normal_velocity
from jaxcam.parameters import as_arrays

from .orbits import by_product, eigenvalues, Method, Orbit, turn_derivative


class Stability(eqx.Module):
    """Stability of an orbit, from its monodromy matrix M and the multipliers mu_i."""

    multipliers: Complex[Array, " n"]
    """Floquet multipliers, largest modulus first, shape `(n,)`."""
    vectors: Complex[Array, "n n"]
    """Eigenvectors, one column per multiplier, shape `(n, n)`."""
    fold: Float[Array, ""]
    """det(M - I) times `scale`: zero at a fold."""
    flip: Float[Array, ""]
    """det(M + I) times `scale`: zero at a flip."""
    neimark_sacker: Float[Array, ""]
    """The product of mu_i mu_j - 1 over i < j, times `scale`: zero at a Neimark-Sacker
    bifurcation."""
    scale: Float[Array, ""]
    """A factor between 0 and 1: the smallest value of v / (v + |a| period) over the
    impacts, with impact speed v and acceleration a of the gap. It vanishes at grazing,
    where M grows like 1/v.
    """
    reason: str = eqx.field(static=True)
    """Reason why some multipliers must be zero; otherwise empty."""

    @property
    def stable(self) -> bool:
        """Return whether all multipliers lie inside the unit circle."""
        return bool(jnp.all(jnp.abs(self.multipliers) < 1))


def floquet_multipliers(
    system: HybridSystem,
    orbit: Orbit,
    *,
    method: Method = "product",
    settings: Settings | None = None,
) -> Complex[Array, " n"]:
    """Return the Floquet multipliers of a periodic orbit, largest modulus first.

    Args:
        system: The system.
        orbit: The periodic orbit.
        method: As for [`variational.monodromy`][].
        settings: Accuracy of the method "flow"; the default tolerance is 1e-12.

    Returns:
        Multipliers, shape `(n,)`, complex. At least two are zero if the orbit sticks,
            because contact sets gap and normal velocity to zero regardless of their
            previous values.

    Examples:
        >>> import continuation, variational
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0])
        >>> product = np.prod(variational.floquet_multipliers(system, orbit))
        >>> round(float(product.real), 6)  # the square of the restitution
        0.64
    """
    if method == "product" and not isinstance(system, SwitchedSystem):
        return _multipliers(as_arrays(system), orbit.state, orbit.pieces, orbit.sticks)
    made = turn_derivative(system, orbit, method=method, settings=settings)
    return eigenvalues(made.state, made.determinant)


@program
def _multipliers(system, state, pieces, sticks):
    made = by_product(system, jnp.zeros(0), None, state, pieces, sticks)
    return eigenvalues(made.state, made.determinant)


def stability(system: HybridSystem, orbit: Orbit) -> Stability:
    """Return the multipliers, eigenvectors and test functions of a periodic orbit.

    The test functions are computed from the multipliers (Kuznetsov, Elements of Applied
    Bifurcation Theory, section 10.2) and multiplied by a factor proportional to the
    impact speed, so that they remain bounded as an impact approaches grazing, and
    change sign only at a bifurcation.

    Args:
        system: The system.
        orbit: The periodic orbit.

    Returns:
        A [`variational.floquet.Stability`][].

    Examples:
        >>> import continuation, variational
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0])
        >>> variational.stability(system, orbit).multipliers.shape
        (2,)
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
    """Return det(M - I), det(M + I) and the product of mu_i mu_j - 1 over i < j, for a
    monodromy matrix M with multipliers mu_i.

    Args:
        multipliers: Eigenvalues of M, shape `(n,)`.

    Returns:
        Three real scalars.

    Examples:
        >>> from variational.floquet import test_functions
        >>> fold, flip, _ = test_functions(jnp.array([0.5 + 0j, -1.0]))
        >>> float(fold), float(flip)
        (1.0, 0.0)
    """
    i, j = np.triu_indices(multipliers.shape[0], k=1)
    return (
        jnp.prod(multipliers - 1).real,
        jnp.prod(multipliers + 1).real,
        jnp.prod(multipliers[i] * multipliers[j] - 1).real,
    )


# otherwise, pytest would collect the function as a test
test_functions.__test__ = False  # pyright: ignore[reportFunctionMemberAccess]


def impact_scale(system: HybridSystem, orbit: Orbit) -> Float[Array, ""]:
    """Return the smallest v / (v + |a| period) over the impacts, or 1 if there are none
    or the orbit sticks.

    Here v is the speed of an impact and a the acceleration of the gap just before it;
    |a| period / v is approximately the largest entry of its saltation matrix.

    Args:
        system: The system.
        orbit: The periodic orbit.

    Returns:
        A scalar between 0 and 1.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational import orbit_of
        >>> from variational.floquet import impact_scale
        >>> ball = BouncingBall(restitution=1.0)
        >>> orbit = orbit_of(ball, [9.81 / 8, 0.0], period=1.0)
        >>> round(float(impact_scale(ball, orbit)), 6)  # v = g / 2, a = g, period 1
        0.333333
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


@program
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
            "All multipliers are zero because the orbit sticks: in contact, gap and "
            "normal velocity are zero regardless of their previous values, and they "
            "determine both states."
        )
    return (
        "At least two multipliers are zero because the orbit sticks: in contact, gap "
        "and normal velocity are zero regardless of their previous values."
    )
