"""Select hidden elements worth fitting, and remove parts that are not needed."""

import dataclasses
import math

import numpy as np

from ...fitting import Problem
from ..policy import Policy
from ._free_fits import FreeFits, Missing, Subset
from ._hidden_kinds import RESONANCE
from ._hidden_scan import Promise, promises
from ._hidden_signals import Driven
from ._hidden_state import Hidden
from ._local_force import Response
from ._vibration_scan import periodogram


def worthwhile(
    problem: Problem,
    response: Response,
    driven: Driven,
    policy: Policy,
    heat: float,
    least: float = 0.0,
) -> list[tuple[float, Promise]]:
    """Return the predicted gains of hidden elements, minus the penalty for their
    parameters.

    A resonance that gains less than a force at one frequency with a separate phase in
    each recording is rejected, because such a force is not driven by the motion. This
    is tested only if the largest gain exceeds `least`.
    """
    found = []
    for one in promises(problem, response, driven, policy):
        found.append((one.gain / heat - one.hidden.price(problem.samples), one))
    top = max(found, key=lambda each: each[0])
    if top[0] > least and top[1].hidden.kind is RESONANCE:
        scan = periodogram(problem, response, policy)
        count = 2 * scan.records + 1
        price = count * math.log(problem.samples) + 2 * math.log(scan.cells)
        if scan.best_separate[1] / heat - price > top[0]:
            found.remove(top)
    return found


def simplified(fits: FreeFits, problem: Problem, found: Missing, progress) -> Missing:
    """Return the fit without direct parts of the force that the rig parameters can
    represent.
    """
    for one in found.functions:
        if not isinstance(one, Hidden):
            continue
        kept = fits.needed_parts(found, one)
        if kept == one.direct:
            continue
        progress(f"simplifying {one.label}", None)
        less = dataclasses.replace(one, direct=kept)
        functions = tuple(less if f is one else f for f in found.functions)
        values = np.asarray(found.fit.point.values).copy()
        gone = set(one.direct_parts) - set(less.direct_parts)
        values[:, [problem.names.index(name) for name in gone]] = 0.0
        point = found.fit.point._replace(values=values)
        trial = fits.fitted(Subset(problem, functions, found.names), point)
        if trial.score < found.score:
            found = trial
    return found
