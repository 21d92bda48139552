"""The quadratic likelihood of forces that are functions of two arguments.

They are linear in their coefficients, so one linearisation of the recordings predicts
their gains, and shows which products of forms may be worth a fit.
"""

from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...fitting import Parameter, Problem
from ..policy import Policy
from ..terms import (
    Bivariate,
    BivariateForce,
    Factor,
    Family,
    Motion,
    Term,
    Variable,
    Where,
)
from ._local_force import blocks_at_nodes, forces_at_nodes, Response
from ._roughness import beside, Roughness, roughness


# Arguments that may be combined
_COMBINED = (
    (Variable.VELOCITY, Variable.POSITION),
    (Variable.PHASE, Variable.POSITION),
    (Variable.PHASE, Variable.VELOCITY),
)
_AT_NODES = (Variable.POSITION, Variable.VELOCITY, Variable.PHASE)


class _Arguments(Term):
    """A force whose derivatives with respect to its strengths are the arguments."""

    name: ClassVar[str] = "arguments"
    sentence: ClassVar[str] = "a force that is linear in its arguments"
    listed: ClassVar[bool] = False
    parts: tuple[Array, ...] = eqx.field(
        default=(0.0,) * len(_AT_NODES),
        converter=lambda values: tuple(jnp.asarray(x, dtype=float) for x in values),
    )

    def acceleration(self, motion: Motion):
        place, rate, turn = self.parts
        moved = place * motion.position + rate * motion.velocity
        return moved + turn * motion.phase

    def numbers(self) -> tuple[Array, ...]:
        return self.parts

    def parameters(self, place: int) -> list[Parameter]:
        raise NotImplementedError("The parts of this force are never fitted.")


class Nodes(NamedTuple):
    """The arguments of forces at the nodes of all pieces, `(r, k, l)` each, with the
    linearisation about a point.
    """

    problem: Problem
    response: Response
    heat: float
    along: dict[Variable, Float[np.ndarray, "r k l"]]

    @classmethod
    def of(cls, problem: Problem, response: Response, heat: float) -> "Nodes":
        """Return the arguments at the nodes of a response."""
        every = forces_at_nodes(response, [_Arguments()])
        along = {name: every[..., k] for k, name in enumerate(_AT_NODES)}
        return cls(problem, response, heat, along)

    def quadratic(self, forces: Float[np.ndarray, "r k l p"]):
        """Return information and score, divided by the cost per sample, the rows of
        the free parameters, and those of the given forces.
        """
        count = forces.shape[-1]
        names = [f"force_{k}" for k in range(count)]
        blocks = blocks_at_nodes(
            self.problem, self.response, forces, names, np.ones(count)
        )
        information, score = (x / self.heat for x in blocks.total())
        return information, score, blocks.rows(self.response.free), blocks.rows(names)

    def place(self, family: Family) -> tuple[np.ndarray, np.ndarray]:
        """Return the argument of a family, within its range if it is a phase, and the
        direction of motion if the functions of the family may jump.
        """
        at = self.along[family.argument]
        if family.periodic:
            at = np.mod(at, family.high - family.low)
        slow = np.tanh(at / family.slip) if family.jumps else np.zeros_like(at)
        return at, slow


class BivariateLikelihood(NamedTuple):
    """The likelihood of the coefficients of a force of two arguments, all other
    parameters eliminated.

    `information` `(a, b, a, b)` and `slope` `(a, b)`, divided by the cost per sample;
    `rough`: the smoothness prior, with the predicted gain.
    """

    family: Bivariate
    information: Float[np.ndarray, "a b a b"]
    slope: Float[np.ndarray, "a b"]
    rough: Roughness


def bivariate_forces(families: Sequence[Family]) -> list[Bivariate]:
    """Return the forces of all pairs of arguments that may be combined."""
    alone = {
        f.argument: f
        for f in families
        if f.where is Where.FLIGHT and f.factor is Factor.ONE
    }
    return [
        Bivariate(alone[one], alone[other])
        for one, other in _COMBINED
        if one in alone and other in alone
    ]


def likelihood_of(
    nodes: Nodes, family: Bivariate, policy: Policy
) -> BivariateLikelihood:
    """Return the likelihood of a force of two arguments about the point of a response,
    where it is zero.
    """
    forces = bivariate_at_nodes(nodes, family)
    used = forces.shape[-1]
    # all functions share one compiled program
    padding = [(0, 0)] * 3 + [(0, BivariateForce.size - used)]
    information, score, free, own = nodes.quadratic(np.pad(forces, padding))
    quadratic = information, score, free, own[:used]
    rough = roughness(*quadratic, family, np.zeros(used), policy)
    inside, pull = beside(*quadratic, policy.distinct_information)
    shape = family.shape
    return BivariateLikelihood(
        family, inside.reshape(*shape, *shape), pull.reshape(shape), rough
    )


def bivariate_at_nodes(nodes: Nodes, family: Bivariate) -> Float[np.ndarray, "r k l p"]:
    """Return the contribution of each coefficient of a force at the nodes."""
    at = []
    for one in family:
        place, _ = nodes.place(one)
        at.append(np.clip(place, one.low, one.high))
    found = family.basis(*(one.ravel() for one in at))
    return found.reshape(*at[0].shape, -1)
