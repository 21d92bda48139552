"""Dry friction that acts in one direction of motion only.

It equals Coulomb friction of half its size and a constant force, and the parameters of
a rig may represent a constant force. If, with Coulomb friction, they are far from their
nominal values because they represent such a force, friction in one direction is more
likely.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from ..policy import Policy
from ..terms import (
    BACKWARD,
    ConstantForce,
    CoulombFriction,
    Factor,
    Family,
    FORWARD,
    Primitive,
    Variable,
    Where,
)
from ._free_fits import Missing, Subset
from ._free_search import FreeSearch
from ._gains import gain, newton_step
from ._heat import heat_of
from ._local_force import force_blocks
from ._named_parts import friction_in_flight
from ._roughness import Roughness
from ._slots import Free, replaced, slots_of
from ._starting_at import starting_at
from ._trials import Trial, Trials


class OneDirection(NamedTuple):
    """Friction in one direction of motion, in place of Coulomb friction.

    - `form`: the direction, as a form of the velocity; `size`: the acceleration.
    - `worse`: the predicted increase in cost, divided by the cost per sample.
    - `hidden`: the rig parameter whose tolerance says most about the difference.
    """

    form: Primitive
    size: float
    worse: float
    hidden: str

    def preferred(self, policy: Policy) -> bool:
        """Return whether the recordings favour friction in one direction so much that
        this is wrong with a probability of at most `1 - policy.confidence`, whatever
        the parameters of the rig say about a constant force.

        With Coulomb friction, the change in cost for a direction has a normal
        distribution with mean `r**2` and standard deviation `2*r`, where `r` is the
        ratio of the friction to the error of a constant force. Each of the two
        directions may be wrong.
        """
        least = float(norm.isf((1 - policy.confidence) / 2))
        return self.worse < -(least**2)


def one_direction(trials: Trials, best: Trial) -> OneDirection | None:
    """Return the more likely direction, according to the quadratic likelihood about a
    fit; `None` if the fit has no Coulomb friction in flight, or a constant force.
    """
    friction = [
        term
        for term in trials.terms
        if term.name in best.names and friction_in_flight(term)
    ]
    if not friction or ConstantForce.name in best.names:
        return None
    (strength,) = friction[0].strengths()
    value = best.fit[strength.name].value
    response, heat = trials.response(best.names), heat_of(best.fit)
    blocks = force_blocks(trials.problem, response, [ConstantForce()])
    information, score = (part.copy() for part in blocks.total())
    own = len(blocks.names) - 1
    # while a fit is poor, the priors weigh more (see `FreeFits`)
    information[np.arange(own), np.arange(own)] += (heat - 1) * response.prior
    score[:own] += (heat - 1) * response.pull
    rows = blocks.rows(response.free)
    free = rows[rows < own]
    (row,) = blocks.rows([strength.name])
    top = gain(information, score, free)

    def tried(form: Primitive, sense: float) -> OneDirection:
        step = np.zeros(len(blocks.names))
        step[own] = sense * value / blocks.scale[own]
        lost = float(step @ information @ step - 2 * step @ score)
        # the constant force remains as large as the friction
        tied = np.eye(len(blocks.names))
        tied[own, row] = sense * blocks.scale[row] / blocks.scale[own]
        squares, slope = (
            tied.T @ information @ tied,
            tied.T @ (score - information @ step),
        )
        worse = (top + lost - gain(squares, slope, free)) / heat
        shift, covariance = newton_step(squares, slope, free)
        pull = response.prior[free] * shift**2
        if not np.any(pull):
            pull = shift**2 / np.diag(covariance)
        hidden = blocks.names[free[int(np.argmax(pull))]]
        return OneDirection(form, 2 * sense * value, worse, hidden)

    # with Coulomb friction, a constant force vanishes in one direction
    found = [tried(FORWARD, -1.0), tried(BACKWARD, 1.0)]
    return min(found, key=lambda one: one.worse)


def in_one_direction(
    search: FreeSearch, families: Sequence[Family], best: Trial, wanted: OneDirection
) -> Missing:
    """Return a fit with friction in one direction, in place of Coulomb friction."""
    family = next(
        one
        for one in families
        if (one.where, one.argument, one.factor)
        == (Where.FLIGHT, Variable.VELOCITY, Factor.ONE)
    )
    problem, names = search.problem, best.names - {CoulombFriction.name}
    slot = slots_of(problem, Where.FLIGHT)[0]
    size = Roughness(size=abs(wanted.size))
    form = Free(family, size, slot, wanted.form)
    point = starting_at(best.fit, problem)
    gone = search.left_out.strengths[CoulombFriction.name]
    columns = [problem.names.index(name) for name in (*gone, *form.coefficients)]
    values = replaced(point.values, columns, [*(0.0 for _ in gone), wanted.size])
    point = point._replace(values=values)
    # the parameters of the rig may have to move far, which pieces of flight allow
    for part in (search.apart, problem):
        found = search.fits.fitted(Subset(part, (form,), names), point)
        point = found.fit.point
    return found
