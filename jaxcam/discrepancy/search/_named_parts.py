"""Find dry friction in a function of the velocity that is a sum of forms."""

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np

from ..terms import (
    BACKWARD,
    CoulombFriction,
    DRY,
    Factor,
    FORWARD,
    Primitive,
    sum_of,
    Term,
    Variable,
    Where,
)
from ._clock import Clock
from ._free_fits import FreeFits, Missing, Subset
from ._roughness import Roughness
from ._slots import emptied, Free, replaced


def friction_named(fits: FreeFits, found: Missing, one: Free) -> bool:
    """Return whether Coulomb friction may be named in addition to a function."""
    family = one.family.where, one.family.argument, one.family.factor, one.gate
    of_velocity = family == (Where.FLIGHT, Variable.VELOCITY, Factor.ONE, None)
    free = CoulombFriction.name not in found.names
    return of_velocity and free and any(map(friction_in_flight, fits.terms))


def friction_in_flight(term: Term) -> bool:
    """Return whether a term is the Coulomb friction of the first coordinate, on which
    unnamed forces act.
    """
    return isinstance(term, CoulombFriction) and term.coordinate == 0


def with_named_friction(
    fits: FreeFits,
    found: Missing,
    one: Free,
    sums: Iterable[tuple[Primitive, np.ndarray]],
    progress,
    clock: Clock,
) -> list[Missing]:
    """Return fits with Coulomb friction as a named term and another form, in place of a
    function of the velocity.

    **Arguments:** the function; sums of forms that contain friction, with their
    parameters; the limit of the time.
    """
    term = next(term for term in fits.terms if friction_in_flight(term))
    own, problem = [strength.name for strength in term.strengths()], found.problem
    tried = []
    for whole, numbers in sums:
        split = without_friction(whole, numbers)
        if split is None or clock.over:
            continue
        friction, rest, left = split
        size = Roughness(size=abs(float(left[0])))
        form = dataclasses.replace(one, primitive=rest, roughness=size)
        parts = tuple(form if f.slot == one.slot else f for f in found.functions)
        values = emptied(problem, found.fit.point.values, one.slot)
        columns = [problem.names.index(each) for each in (*form.coefficients, *own)]
        values = replaced(values, columns, [*left, friction])
        point = found.fit.point._replace(values=values)
        progress(f"fitting Coulomb friction and a formula: {rest.name}", None)
        subset = Subset(problem, parts, found.names | {term.name})
        trial = fits.fitted(subset, point)
        if all(trial.fit[name].value > 0 for name in own):
            tried.append(trial)
    return tried


def without_friction(
    form: Primitive, numbers: Sequence[float] | np.ndarray
) -> tuple[float, Primitive, np.ndarray] | None:
    """Return the Coulomb friction that a sum of forms of the velocity contains, and the
    rest of the sum with its parameters; `None` if it contains none.

    Different forces opposing the two directions of motion are Coulomb friction as large
    as the smaller of them, and an additional force in one direction.
    """
    parts = [(part, np.array(own)) for part, own in form.divided(numbers)]
    sizes = {part.name: own[0] for part, own in parts}
    if DRY.name in sizes:
        friction = -sizes[DRY.name]
        taken = {DRY.name: friction}
    else:
        friction = min(-sizes.get(FORWARD.name, 0.0), sizes.get(BACKWARD.name, 0.0))
        taken = {FORWARD.name: friction, BACKWARD.name: -friction}
    if len(parts) < 2 or not friction > 0:
        return None
    for part, own in parts:
        own[0] += taken.get(part.name, 0.0)
    kept = [(part, own) for part, own in parts if own[0] != 0]
    if not kept:
        return None
    rest = tuple(part for part, _ in kept)
    whole = rest[0] if len(rest) == 1 else sum_of(rest, [own[0] for _, own in kept])
    return friction, whole, np.concatenate([own for _, own in kept])
