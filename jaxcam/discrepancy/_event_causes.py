"""Which physics would bring the speeds at which a motion changes to those observed.

For a rig of which no recording is left, but the speeds at which its motion changed:
each term is given the strength, and the rig the restitution, with which the four speeds
come nearest.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from ..hybrid import HybridSystem
from ._event_speeds import event_speeds, EventSpeeds
from ._term import Term
from ._with_terms import WithTerms


# Strengths along the way to large ones: their ratio, the first, and how many
_RATIO, _FIRST, _MOST = 1.5, 0.1, 24
# What a speed that does not exist counts, in its errors
_ABSENT = 10.0


@dataclasses.dataclass(frozen=True)
class EventCause:
    """One explanation.

    - `name`: of the term, or `"none"`; `strength` with its `unit`; `beside`: the
        parameter of the rig that was fitted with it.
    - `speeds`: shape `(4,)`, rad/s, in the order of `event_speeds`.
    - `misfit`: sum of squares of what is left, in the errors of the observations.
    """

    name: str
    strength: float
    unit: str
    beside: float
    speeds: Float[np.ndarray, "4"]
    misfit: float


def event_causes(
    rig: HybridSystem,
    observed: Sequence[float],
    errors: Sequence[float],
    terms: Sequence[Term],
    where: Callable,
    tolerance: float,
) -> tuple[EventCause, ...]:
    """Rank terms by how near they bring the four speeds to those observed.

    **Arguments:**

    - `rig`: a [`jaxcam.models.CamFollower`][].
    - `observed`, `errors`: four speeds (rad/s), in the order of `event_speeds`, NaN
        where one was not seen, and how well each is known.
    - `terms`: candidates with one strength each.
    - `where`, `tolerance`: a parameter of the rig that is fitted beside each term, and
        how far it may be off; `lambda rig: rig.restitution.intercept`.

    **Returns:** explanations, the best first; one of them is no term at all.
    """
    terms = tuple(terms)
    system = jax.tree.map(jnp.asarray, WithTerms(rig, terms))
    found = [_Fit(system, None, observed, errors, where, tolerance).best()]
    found += [
        _Fit(system, place, observed, errors, where, tolerance).best()
        for place in range(len(terms))
    ]
    return tuple(sorted(found, key=lambda one: one.misfit))


class _Fit:
    """The fit of one term, and of the parameter beside it."""

    def __init__(self, system: WithTerms, place, observed, errors, where, tolerance):
        self.system, self.place = system, place
        self.observed, self.errors = np.asarray(observed), np.asarray(errors)
        self.where, self.tolerance = where, tolerance
        self.nominal = float(where(system.base))
        self.near = event_speeds(system)
        # where the next search begins: the speeds are smooth in both numbers
        self.start = self.near

    def best(self) -> EventCause:
        name, strength = "none", None
        if self.place is not None:
            term = self.system.terms[self.place]
            name, strength = term.name, term.strengths()[0]
        if strength is None:
            found = least_squares(lambda x: self.left(0.0, x[0]), [0.0], diff_step=1e-3)
            return self.cause(name, 0.0, "", found.x[0])
        size, paths = strength.size, []
        for sign in (1.0,) if strength.lower >= 0 else (1.0, -1.0):
            self.near = self.start
            paths.append(self.along(sign * size))
        first, self.near = min(paths, key=lambda one: one[0])[1:]
        found = least_squares(
            lambda x: self.left(size * x[0], x[1]),
            [first / size, 0.0],
            diff_step=1e-3,
            max_nfev=40,
        )
        return self.cause(name, size * found.x[0], strength.unit, found.x[1])

    def along(self, size: float) -> tuple[float, float, EventSpeeds]:
        """The best strength on the way from nothing, in steps that can be followed."""
        found = (math.inf, 0.0, self.near)
        for k in range(_MOST):
            strength = size * _FIRST * _RATIO**k
            misfit = float(np.sum(self.left(strength, 0.0) ** 2))
            if misfit < found[0]:
                found = misfit, strength, self.near
            if misfit > 4 * found[0] or not np.isfinite(self.near.values).any():
                break
        return found

    def at(self, strength: float, beside: float) -> EventSpeeds:
        system = self.system
        if self.place is not None:
            system = eqx.tree_at(
                lambda s: s.terms[self.place].numbers()[0],
                system,
                jnp.asarray(strength),
            )
        value = jnp.asarray(self.nominal + self.tolerance * beside)
        return self.near.near(eqx.tree_at(lambda s: self.where(s.base), system, value))

    def left(self, strength: float, beside: float) -> np.ndarray:
        """What is left of each speed, and of the parameter, in their errors."""
        found = self.at(strength, beside)
        if np.isfinite(found.values).all():
            self.near = found
        seen = np.isfinite(self.observed)
        off = (found.values - self.observed)[seen] / self.errors[seen]
        return np.append(np.where(np.isfinite(off), off, _ABSENT), beside)

    def cause(self, name: str, strength: float, unit: str, beside: float) -> EventCause:
        left = self.left(strength, beside)
        speeds = self.at(strength, beside).values
        parameter = self.nominal + self.tolerance * beside
        misfit = float(np.sum(left**2))
        return EventCause(name, float(strength), unit, parameter, speeds, misfit)
