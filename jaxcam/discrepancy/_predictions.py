"""Predict the behaviour of a rig, with and without the missing physics."""

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..fitting import Fit
from ..models import CamFollower
from ._event_speeds import event_speeds, EVENTS
from .policy import Policy
from .report import Diagnosis
from .terms import Value, WithTerms


# Regularisation of a covariance, relative to unit variance
_DEFINITE = 1e-12


@dataclasses.dataclass(frozen=True)
class Prediction:
    """A predicted speed of the cam (rad/s) at which the motion changes.

    `before` and `after` are the predictions of the refitted textbook model without and
    with the missing effects. Their standard errors follow from those of the fits. A
    prediction and its standard error are NaN if there is no such speed.

    Examples:
        >>> from jaxcam.discrepancy import Prediction
        >>> from jaxcam.discrepancy.terms import Value
        >>> Prediction("fold", Value(14.2, 0.1), Value(14.5, 0.2)).after.value
        14.5
    """

    name: str
    """The change, such as "fold"."""
    before: Value
    """Prediction of the refitted textbook model, with its standard error; NaN if there
    is no such speed.
    """
    after: Value
    """Prediction with the missing effects."""


def predictions(
    found: Diagnosis,
    seed: int = 0,
    *,
    progress: Callable[[float], None] | None = None,
) -> tuple[Prediction, ...]:
    """Predict the speeds at which the motion of a cam-follower rig changes.

    The speeds are predicted with the refitted textbook model, without and with the
    missing effects: those of detachment (valve float), of the fold and the flip of
    P(1,1) (the orbit with one impact per revolution of the cam), and of the
    interruption of complete chatter. Their standard errors are estimated from random
    rigs, drawn from the distribution of the fitted parameters. Missing effects with a
    frequency of their own are left out, because they make the motion aperiodic: it does
    not repeat with the cam. [Predicted
    changes](../discrepancy.md#predicted-changes-of-the-motion) shows an example, which
    takes minutes.

    Args:
        found: The diagnosis.
        seed: Seed of the random rigs.
        progress: Called with the fraction of rigs completed.

    Returns:
        The predictions; none for a system other than a cam-follower.
    """
    if not isinstance(found.after.model(0).system.base, CamFollower):  # pyright: ignore
        return ()
    sides = []
    for fit, present in ((found.before, False), (found.after, True)):
        rng = np.random.default_rng(seed)
        part = None if progress is None else partial(_half, progress, present)
        sides.append(_speeds(fit, found.names, present, rng, found.policy, part))
    return tuple(
        Prediction(name, *(Value(float(v), float(e), "rad/s") for v, e in pair))
        for name, *pair in zip(EVENTS, *sides)
    )


def _half(progress, second: bool, share: float) -> None:
    progress((share + second) / 2)


def _speeds(
    fit: Fit, names, present: bool, rng, policy: Policy, progress
) -> list[tuple[float, float]]:
    """Return the speeds and their standard errors."""
    row = np.asarray(fit.point.values[0])
    best = event_speeds(_system(fit, row, names, present), policy)
    drawn = []
    for k, moved in enumerate(_draws(fit, policy.drawn_rigs, rng)):
        drawn.append(best.near(_system(fit, moved, names, present)).values)
        if progress is not None:
            progress((k + 1) / policy.drawn_rigs)
    errors = [_spread(column) for column in np.array(drawn).T]
    return [(float(v), e) for v, e in zip(best.values, errors)]


def _draws(fit: Fit, number: int, rng) -> Iterator[np.ndarray]:
    """Return parameter values of the first recording, drawn from their distribution.

    Parameters that the data do not constrain keep their values.
    """
    row, spread = np.asarray(fit.point.values[0]), np.sqrt(np.diag(fit.covariance))
    kept = [
        k
        for k, one in enumerate(fit.estimates)
        if one.record in (None, fit.problem.records[0]) and np.isfinite(spread[k])
    ]
    free = [fit.problem.names.index(fit.estimates[k].name) for k in kept]
    scale = spread[kept]
    root = np.linalg.cholesky(
        fit.covariance[np.ix_(kept, kept)] / np.outer(scale, scale)
        + _DEFINITE * np.eye(len(scale))
    )
    for _ in range(number):
        moved = row.copy()
        moved[free] += scale * (root @ rng.standard_normal(len(free)))
        yield moved


def _spread(drawn: np.ndarray) -> float:
    known = drawn[np.isfinite(drawn)]
    return float(np.std(known, ddof=1)) if len(known) > 2 else float("nan")


def _system(fit: Fit, values: np.ndarray, names, present: bool) -> WithTerms:
    """Return the rig with given parameter values and terms; unless these are `present`,
    their strengths are zero.

    Both models have the same structure, so one compiled program serves both.
    """
    model = fit.problem.layout.at(jnp.asarray(values))
    system = model.system
    assert isinstance(system, WithTerms)
    terms = tuple(
        term if present else jax.tree.map(jnp.zeros_like, term)
        for term in system.terms
        if term.name in names
        and term.acts
        and not any(one.inner for one in term.strengths())
    )
    system = dataclasses.replace(system, terms=terms)
    return jax.tree.map(jnp.asarray, eqx.tree_at(_phase, system, 0.0))


def _phase(system: WithTerms):
    return system.base.phase  # pyright: ignore
