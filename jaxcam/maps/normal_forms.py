"""Normal forms of the local bifurcations of codimension one (thesis, Figure 2.7)."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np


class NormalForm(NamedTuple):
    """A normal form with its branches in closed form.

    It is a vector field x' = f(x, mu), or a map if `discrete`. For the Hopf
    bifurcation, x is the radius.
    """

    title: str
    """Name of the bifurcation."""
    field: Callable
    """The vector field or map, `f(x, mu)`."""
    branches: tuple[Callable, ...]
    """Branches as functions of mu; NaN where they do not exist."""
    discrete: bool = False
    """Whether `field` is a map."""

    def stable(self, branch: int, mu) -> np.ndarray:
        """Return whether a branch is attracting at each `mu`, from the derivative of
        the field.
        """
        mu = np.atleast_1d(np.asarray(mu, dtype=float))
        x = np.asarray(self.branches[branch](mu), dtype=float)
        slope = jax.vmap(jax.grad(self.field))(jnp.asarray(x), jnp.asarray(mu))
        # the multiplier of a period-two orbit of an odd map is the square of the slope,
        # so the same condition applies
        return np.abs(slope) < 1 if self.discrete else np.asarray(slope) < 0


def _zero(mu):
    return np.zeros_like(mu)


def _root(sign):
    def branch(mu):
        return sign * np.sqrt(np.where(mu >= 0, mu, np.nan))

    return branch


NORMAL_FORMS: dict[str, NormalForm] = {
    "fold": NormalForm("Fold", lambda x, mu: mu - x * x, (_root(1), _root(-1))),
    "transcritical": NormalForm(
        "Transcritical", lambda x, mu: mu * x - x * x, (_zero, lambda mu: mu)
    ),
    "pitchfork": NormalForm(
        "Pitchfork", lambda x, mu: mu * x - x**3, (_zero, _root(1), _root(-1))
    ),
    "hopf": NormalForm("Hopf", lambda r, mu: mu * r - r**3, (_zero, _root(1))),
    "period-doubling": NormalForm(
        "Period doubling",
        lambda x, mu: -(1 + mu) * x + x**3,
        (_zero, _root(1), _root(-1)),
        discrete=True,
    ),
}
"""The normal forms of Figure 2.7 of the thesis. The map printed there for period
doubling, (1 + mu) x - x^3, has a multiplier of +1 at the bifurcation, so it undergoes a
pitchfork bifurcation; with the opposite sign, the map undergoes a period doubling.
"""
