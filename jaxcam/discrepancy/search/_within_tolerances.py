"""Refit the model without the missing terms, within the tolerances of the rig."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ...fitting import Fit, fit, Parameter
from ...fitting.engine import nominal_of
from ..policy import Policy
from ._given_up import given_up


def within_tolerances(
    before: Fit, best: Fit, rig: Sequence[str], policy: Policy
) -> Fit:
    """Return the fit without terms, with the rig parameters held within their
    tolerances.

    If physics is missing, the data outweigh the stated rig parameters, and the fitted
    values become unrealistic. The report therefore compares the fit with terms to a rig
    within its tolerances.

    **Arguments:** fits without and with the terms, the names of the rig parameters, and
    the policy. The bounds always include the values of the fit with terms.

    **Returns:** `before` itself if it is within the tolerances.
    """
    problem = before.problem
    bounded = {name: _bounded(problem, best, name) for name in rig}
    values = np.asarray(before.point.values)
    inside = all(
        np.all((column >= one.lower) & (column <= one.upper))
        for name, one in bounded.items()
        for column in [values[:, problem.names.index(name)]]
    )
    if inside:
        return before
    parameters = tuple(bounded.get(one.name, one) for one in problem.parameters)
    return fit(
        dataclasses.replace(problem, parameters=parameters),
        free=before.free,
        start=before.point,
        iterations=policy.quick_iterations,
        stop=given_up(problem.samples, policy),
    )


def _bounded(problem, best: Fit, name: str) -> Parameter:
    """Return the parameter with its tolerance as bounds."""
    parameter = problem.parameter(name)
    place = problem.names.index(name)
    nominal = nominal_of(problem, place)
    known = np.asarray(best.point.values)[:, place]
    low = min(nominal - parameter.tolerance, float(np.min(known)))
    high = max(nominal + parameter.tolerance, float(np.max(known)))
    return dataclasses.replace(
        parameter,
        lower=max(parameter.lower, low),
        upper=min(parameter.upper, high),
    )
