"""Free functions in a problem: their families, priors and slots.

A slot is a term of the problem that has no effect until a function is put into it.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import TypeAlias

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...fitting import Model, Problem
from ...fitting.engine import parameter_places
from ..terms import (
    Bivariate,
    BivariateForce,
    Family,
    FittedFunction,
    FREE,
    FreeFunction,
    Gate,
    HiddenForce,
    more_faults,
    prepared_terms,
    Primitive,
    Term,
    terms_of,
    Where,
)
from ._extended import extended
from ._hidden_signals import Driven
from ._hidden_state import Hidden, with_hidden
from ._roughness import Roughness


# Number of sines of a function; one more coefficient represents its jump
_SINES = {Where.FLIGHT: 20, Where.IMPACT: 10, Where.CONTACT: 24, Where.SENSOR: 20}
# Minimum number of substeps for a force that jumps at edges, so that steps that contain
# an edge are accurate
_SUBSTEPS = 8
# Number of slots for functions of each kind in a problem
_ROOM = ((Where.FLIGHT, "force_a"), (Where.FLIGHT, "force_b"))
_ROOM_OF_SENSOR = ((Where.SENSOR, "sensor_a"),)
ROOM_OF_TWO_ARGUMENTS = "bivariate_force"
"""Label of the slot for a force of two arguments."""
# slots at each gap, whose number is appended to the labels
_ROOM_OF_IMPACTS = ((Where.IMPACT, "restitution"), (Where.CONTACT, "surface"))


@dataclasses.dataclass(frozen=True)
class Free:
    """A fitted free function: its family, its prior, and its slot.

    With a `primitive`, the function has that form and no smoothness prior. With a
    `gate`, it is the product of that form and a second one. If it is `centred`, the
    centre of its family was fitted. With `across`, it is a function of the arguments of
    both families.
    """

    family: Family
    roughness: Roughness
    slot: str
    primitive: Primitive | None = None
    gate: Gate | None = None
    centred: bool = False
    across: Family | None = None

    @property
    def prior(self) -> Family | Bivariate:
        """Return the family of all functions of the same arguments."""
        if self.across is None:
            return self.family
        return Bivariate(self.family, self.across)

    @property
    def label(self) -> str:
        if self.across is not None:
            return self.prior.name
        if self.gate is None:
            return self.family.name
        return f"{self.family.name} times {self.gate.family.argument}"

    @property
    def form(self) -> str:
        """Return the name of the form or product; empty for a sum of sines."""
        name = "" if self.primitive is None else self.primitive.name
        return name if self.gate is None else f"{name} x {self.gate.primitive.name}"

    @property
    def where(self) -> Where:
        return self.family.where

    @property
    def arguments(self) -> tuple[str, ...]:
        """Return the names of all arguments."""
        if self.across is not None:
            return self.prior.arguments
        more = () if self.gate is None else self.gate.family.arguments
        return tuple(dict.fromkeys((*self.family.arguments, *more)))

    @property
    def smooth(self) -> bool:
        """Return whether the function has a smoothness prior."""
        return self.primitive is None

    @property
    def jumps(self) -> bool:
        """Return whether the function is a force that jumps at edges."""
        form = self.primitive
        sharp = form is not None and form.sharp
        if self.gate is not None:
            sharp |= self.gate.primitive.sharp
        return self.where is Where.FLIGHT and sharp

    def price(self, samples: int) -> float:
        """Return the gain that the function's parameters require, without the Occam
        factor of its prior.
        """
        return self.count * math.log(samples)

    @property
    def count(self) -> int:
        """Return the number of fitted parameters that have no smoothness prior."""
        own = 0 if self.primitive is None else len(self.coefficients)
        return own + int(self.centred)

    @property
    def coefficients(self) -> list[str]:
        """Return the names of the function's parameters in the fit."""
        if isinstance(self.prior, Bivariate):
            return [f"{self.slot}_{k}" for k in self.prior.places]
        sines = _SINES[self.family.where] + 1
        count = self.primitive.count if self.primitive else sines
        places = (*range(count), *(self.gate.places if self.gate else ()))
        return [f"{self.slot}_{k}" for k in places]

    @property
    def spread(self) -> np.ndarray:
        """Return prior standard deviations of the coefficients of a sum of sines, or
        significant changes of the parameters of a form.
        """
        if self.primitive is None:
            count = len(self.coefficients)
            variances = self.prior.prior_variances(count, self.roughness.length)
            return self.roughness.size * np.sqrt(variances)
        more = () if self.gate is None else self.gate.primitive.scales
        return np.array([self.roughness.size, *self.primitive.scales, *more])

    def within(self, numbers: Sequence[float]) -> bool:
        """Return whether the parameters of a form, or of both forms, are valid."""
        assert self.primitive is not None
        count = self.primitive.count
        if self.gate is not None:
            gate = self.gate.primitive
            if not gate.within([1.0, *numbers[count:]]):
                return False
        return self.primitive.within(numbers[:count])


# functions and elements for the slots of a problem
Part: TypeAlias = Free | Hidden


def roomy(
    problem: Problem,
    family: Family,
    gaps: Sequence[int],
    driven: Driven | None,
    bivariate: Bivariate | None = None,
) -> Problem:
    """Return the problem with empty slots for free functions and a hidden element, and
    with the possible errors of the first coordinate's sensor as parameters.

    One compiled program serves all contents of the slots.

    **Arguments:** any family, which fills the slots initially; the indices of the gaps
    at which functions may act; the position that drives a hidden element, if it is
    measured; the arguments of a force of two arguments, whose slot replaces that of the
    first force.
    """
    forces = _ROOM if bivariate is None else _ROOM[1:]
    room = [(where, label, 0) for where, label in (*forces, *_ROOM_OF_SENSOR)]
    for gap in gaps:
        room += [
            (where, f"{label}_{gap + 1}", gap) for where, label in _ROOM_OF_IMPACTS
        ]
    empty: list[Term] = [
        FREE[where].of(
            dataclasses.replace(family, constraint=gap),
            label,
            [0.0] * (_SINES[where] + 1),
        )
        for where, label, gap in room
    ]
    if bivariate is not None:
        empty.append(BivariateForce.of(bivariate, ROOM_OF_TWO_ARGUMENTS))
    if driven is not None:
        empty.append(HiddenForce.empty(*driven.position.shape))
    faults = more_faults(problem.model, problem.parameters)
    wide = extended(problem, empty, problem.start, faults)
    layout = dataclasses.replace(wide.layout, ready=_with_splines, apart=_one_by_one)
    return dataclasses.replace(wide, layout=layout)


def _with_splines(model: Model) -> Model:
    """Return the model with the splines of its functions precomputed."""
    return eqx.tree_at(terms_of, model, prepared_terms(terms_of(model)))


def _one_by_one(model: Model) -> Model:
    """Return the same as `_with_splines`, with a loop for each function."""
    terms = [prepared_terms((one,))[0] for one in terms_of(model)]
    return eqx.tree_at(terms_of, model, tuple(terms))


def slots_of(problem: Problem, where: Where, gap: int = 0) -> list[str]:
    """Return the labels of the slots for functions that act at a given place, and at a
    given gap.
    """
    return [
        term.label
        for term in terms_of(problem.model)
        if isinstance(term, FreeFunction)
        and where in term.acts
        and term.constraint == gap
    ]


def free_term(
    family: Family,
    label: str,
    primitive: Primitive | None = None,
    gate: Gate | None = None,
) -> FreeFunction:
    """Return a zero function of a family, with a given form, or a product of two, if
    there is one.
    """
    zero = [0.0] * (_SINES[family.where] + 1)
    return FREE[family.where].of(family, label, zero, primitive, gate)


def _empty(one: Free) -> FittedFunction:
    """Return a function with its forms, and zero parameters."""
    if isinstance(one.prior, Bivariate):
        return BivariateForce.of(one.prior, one.slot)
    return free_term(one.family, one.slot, one.primitive, one.gate)


def filled(problem: Problem, functions: Sequence[Part], prior: bool = True) -> Problem:
    """Return the problem with functions in their slots and the corresponding priors."""
    for one in functions:
        if isinstance(one, Hidden):
            problem = with_hidden(problem, one)
            continue
        place = _place(problem, one.slot)
        fresh = _empty(one)

        def put(model: Model, place=place, fresh=fresh) -> Model:
            old = terms_of(model)[place]
            assert isinstance(old, FittedFunction)
            new = eqx.tree_at(lambda t: t.coefficients, fresh, old.coefficients)
            return eqx.tree_at(lambda m: terms_of(m)[place], model, new)

        # an unused coefficient needs a prior too, so that it does not move
        spread = np.where(one.spread > 0, one.spread, one.roughness.size)
        smooth = prior and one.primitive is None
        scales = dict(zip(one.coefficients, map(float, spread)))
        known = {
            name: math.sqrt(3) * value if smooth else math.inf
            for name, value in scales.items()
        }
        pieces = problem.pieces
        if one.jumps:
            least = jnp.maximum(pieces.substeps, _SUBSTEPS)
            pieces = dataclasses.replace(pieces, substeps=least)
        problem = dataclasses.replace(
            problem,
            model=put(problem.model),
            pieces=pieces,
            layout=eqx.tree_at(
                lambda part: part.model, problem.layout, put(problem.layout.model)
            ),
            parameters=tuple(
                dataclasses.replace(p, tolerance=known[p.name], scale=scales[p.name])
                if p.name in known
                else p
                for p in problem.parameters
            ),
        )
        if one.gate is not None:
            # a second form adds leaves to the model
            places = parameter_places(problem.layout.model, problem.parameters)
            layout = dataclasses.replace(problem.layout, places=places)
            problem = dataclasses.replace(problem, layout=layout)
    return problem


def emptied(problem: Problem, values, slot: str):
    """Return parameter values with those of a slot set to zero."""
    parameters = terms_of(problem.model)[_place(problem, slot)].parameters(0)
    rows = [problem.names.index(p.name) for p in parameters if p.known is None]
    return replaced(values, rows, 0.0)


def replaced(values, columns, numbers) -> Array:
    """Return parameter values with some columns replaced; nothing is compiled."""
    values = np.array(values)
    values[:, columns] = numbers
    return jnp.asarray(values)


def _place(problem: Problem, slot: str) -> int:
    for place, term in enumerate(terms_of(problem.model)):
        if isinstance(term, FittedFunction | HiddenForce) and term.label == slot:
            return place
    raise ValueError(f"There is no slot {slot!r} for a free function.")
