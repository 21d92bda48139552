"""Find the physics that would shift predicted transition speeds to the observed ones.

No recordings are needed, only the speeds at which the type of motion of a rig changes
(transition speeds). The strength of each term and one parameter of the rig are fitted
to these speeds.
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

from ..models import CamFollower
from ._event_speeds import event_speeds, EventSpeeds
from .policy import Policy
from .terms import Term, WithTerms


@dataclasses.dataclass(frozen=True)
class EventCause:
    """One explanation of the observed speeds."""

    name: str
    """Name of the term, or `"none"`."""
    strength: float
    """Strength of the term."""
    unit: str
    """Unit of the strength."""
    beside: float
    """Value of the rig parameter that was fitted together with the strength."""
    speeds: Float[np.ndarray, "4"]
    """Speeds (rad/s), shape `(4,)`: detachment, fold and flip of P(1,1), interruption
    of chatter; NaN if there is none.
    """
    misfit: float
    """Sum of the squared residuals of the speeds, in units of their standard errors,
    and the squared deviation of the parameter, in units of its tolerance.
    """


def event_causes(
    rig: CamFollower,
    observed: Sequence[float],
    errors: Sequence[float],
    terms: Sequence[Term],
    where: Callable,
    tolerance: float,
    *,
    policy: Policy = Policy(),
    progress: Callable[[float], None] | None = None,
) -> tuple[EventCause, ...]:
    """Rank terms by how well they explain the speeds at which the type of motion
    changes.

    Each term is tried alone. Four speeds hardly distinguish between terms: terms
    whose misfit is within a few units of the smallest are equally good. [Diagnosis from
    speeds](../discrepancy.md#speeds-instead-of-recordings) shows an example, which
    takes minutes.

    Args:
        rig: The rig.
        observed: Observed speeds of detachment (valve float), of the fold and the flip
            of P(1,1) (the orbit with one impact per revolution of the cam), and of the
            interruption of chatter (rad/s); NaN for a speed that was not observed.
        errors: Standard error of each speed (rad/s).
        terms: Candidate terms, each with one strength.
        where: Selects the parameter of the rig that is fitted together with each term,
            such as `lambda rig: rig.restitution.intercept`.
        tolerance: Tolerance of this parameter.
        policy: Settings that limit the range of strengths searched.
        progress: Called with the fraction of terms completed.

    Returns:
        Explanations, the best first, including the one without a term.

    Raises:
        ValueError: A term has several strengths, or `observed` does not contain four
            speeds.
    """
    if np.shape(observed) != (4,) or np.shape(errors) != (4,):
        raise ValueError(
            "Give four speeds and four errors (valve float, fold, flip, interruption), "
            "with NaN for a speed that was not observed."
        )
    for term in terms:
        if len(term.strengths()) != 1:
            raise ValueError(
                f"The term {term.name!r} has {len(term.strengths())} strengths; only "
                "terms with one strength can be distinguished by so few speeds."
            )
    goal = _Goal(np.asarray(observed), np.asarray(errors), where, tolerance, policy)
    paths, here = [], None
    for term in terms or (None,):
        system = WithTerms(rig, () if term is None else (term,))
        # at zero strength, no term changes the rig, so all paths share one start
        paths.append(_Path(goal, jax.tree.map(jnp.asarray, system), here))
        here = paths[0].here
    found = [_none(paths[0])]
    for path, term in zip(paths, terms):
        found.append(_best(path, term))
        if progress is not None:
            progress((len(found) - 1) / len(terms))
    return tuple(sorted(found, key=lambda one: one.misfit))


@dataclasses.dataclass(frozen=True)
class _Goal:
    observed: Float[np.ndarray, "4"]
    errors: Float[np.ndarray, "4"]
    where: Callable
    tolerance: float
    policy: Policy

    def left(self, speeds, pull: float) -> Float[np.ndarray, " m"]:
        """Return the residuals of the speeds and of the parameter, in standard
        errors.
        """
        off = ((speeds - self.observed) / self.errors)[np.isfinite(self.observed)]
        return np.append(
            np.where(np.isfinite(off), off, self.policy.absent_errors), pull
        )


class _Path:
    """The four speeds of a rig, followed in small steps of strength and parameter."""

    def __init__(self, goal: _Goal, system: WithTerms, here: EventSpeeds | None):
        self.goal, self.system = goal, system
        self.nominal = float(goal.where(system.base))
        if here is None:
            here = event_speeds(self.changed(0.0, 0.0), goal.policy)
        self.here = here

    def changed(self, strength: float, pull: float) -> WithTerms:
        value = jnp.asarray(self.parameter(pull))
        system = eqx.tree_at(lambda s: self.goal.where(s.base), self.system, value)
        if not system.terms:
            return system
        return eqx.tree_at(
            lambda s: s.terms[0].numbers()[0], system, jnp.asarray(strength)
        )

    def at(self, strength: float, pull: float) -> EventSpeeds:
        return self.here.near(self.changed(strength, pull))

    def left(self, strength: float, pull: float) -> Float[np.ndarray, " m"]:
        found = self.at(strength, pull)
        if np.isfinite(found.values).all():
            # the next search starts from these speeds
            self.here = found
        return self.goal.left(found.values, pull)

    def parameter(self, pull: float) -> float:
        return self.nominal + self.goal.tolerance * pull

    def cause(self, name: str, strength: float, unit: str, pull: float) -> EventCause:
        speeds = self.at(strength, pull).values
        misfit = float(np.sum(self.goal.left(speeds, pull) ** 2))
        return EventCause(name, strength, unit, self.parameter(pull), speeds, misfit)


def _none(path: _Path) -> EventCause:
    start, policy = path.here, path.goal.policy
    found = least_squares(
        lambda x: path.left(0.0, x[0]),
        [0.0],
        diff_step=policy.cause_difference,
        max_nfev=policy.cause_fits,
    )
    cause = path.cause("none", 0.0, "", float(found.x[0]))
    path.here = start
    return cause


def _best(path: _Path, term: Term) -> EventCause:
    strength, start = term.strengths()[0], path.here
    size = strength.size
    ways = []
    for sign in (1.0,) if strength.lower >= 0 else (1.0, -1.0):
        path.here = start
        ways.append(_along(path, sign * size))
    first, path.here = min(ways, key=lambda way: way[0])[1:]
    found = least_squares(
        lambda x: path.left(size * x[0], x[1]),
        [first / size, 0.0],
        bounds=([strength.lower / size, -np.inf], [strength.upper / size, np.inf]),
        diff_step=path.goal.policy.cause_difference,
        max_nfev=path.goal.policy.cause_fits,
    )
    return path.cause(
        term.name, size * float(found.x[0]), strength.unit, float(found.x[1])
    )


def _along(path: _Path, size: float) -> tuple[float, float, EventSpeeds]:
    """Return the smallest misfit for strengths from zero to large ones, with the
    strength and the speeds there.
    """
    best, policy = (math.inf, 0.0, path.here), path.goal.policy
    first, ratio, most = policy.cause_strengths
    for k in range(most):
        strength = size * first * ratio**k
        misfit = float(np.sum(path.left(strength, 0.0) ** 2))
        if misfit < best[0]:
            best = misfit, strength, path.here
        if misfit > policy.cause_worse * best[0]:
            break
    return best
