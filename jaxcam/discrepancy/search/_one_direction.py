"""Dry friction that acts in one direction of motion only.

It equals Coulomb friction of half its size and a constant force, and the parameters of
a rig may represent a constant force. If they must leave their nominal values for that,
the recordings favour friction in one direction.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

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
from ._earlier import starting_at
from ._free_fits import heat_of, Missing, Subset
from ._free_search import FreeSearch
from ._gains import gain, newton_step
from ._local_force import force_blocks
from ._roughness import Roughness
from ._slots import Free, replaced, slots_of
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


def one_direction(trials: Trials, best: Trial) -> OneDirection | None:
    """Return the more likely direction, according to the quadratic likelihood about a
    fit; `None` if the fit has no Coulomb friction.
    """
    if CoulombFriction.name not in best.names:
        return None
    (strength,) = trials.term(CoulombFriction.name).strengths()
    friction = best.fit[strength.name].value
    response = trials.response(best.names)
    blocks = force_blocks(trials.problem, response, [ConstantForce()])
    information, score = blocks.total()
    free, own = blocks.rows(response.free), len(blocks.names) - 1
    top = gain(information, score, free)

    def tried(form: Primitive, force: float) -> OneDirection:
        step = np.zeros(len(blocks.names))
        step[own] = force / blocks.scale[own]
        lost = float(step @ information @ step - 2 * step @ score)
        moved = score - information @ step
        worse = top + lost - gain(information, moved, free)
        shift, _ = newton_step(information, moved, free)
        pull = response.prior[free] * shift**2
        hidden = blocks.names[free[int(np.argmax(pull))]]
        return OneDirection(form, 2 * force, worse / heat_of(best.fit), hidden)

    # with Coulomb friction, a constant force vanishes in one direction
    found = [tried(FORWARD, -friction), tried(BACKWARD, friction)]
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
