"""Forces that are functions of two arguments, judged by a quadratic likelihood.

A surface is a sum of products of the sines (or harmonics) of its two arguments. It is
linear in its coefficients, so one linearisation of the recordings predicts its gain. No
surface is fitted to trajectories: it shows which products of forms may be worth a fit.
"""

from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...fitting import Parameter, Problem
from ..policy import Policy
from ..terms import Factor, Family, free_basis, Motion, Term, Variable, Where
from ._local_force import blocks_at_nodes, forces_at_nodes, Response
from ._roughness import beside, Roughness, roughness


# Number of sines of each argument, and of harmonics with their constant; one more
# coefficient represents a jump
_SINES, _HARMONICS = 10, 9
# Number of coefficients of every surface, so that all share one compiled program; the
# last one has no effect
_WIDTH = (_SINES + 1) ** 2 + 1
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


class Surface(NamedTuple):
    """A function of the arguments of two families.

    It stands for a family in the choice of a smoothness prior.
    """

    first: Family
    second: Family

    @property
    def jumps(self) -> bool:
        return False

    @property
    def shape(self) -> tuple[int, int]:
        """Return the number of coefficients of each argument."""
        return _count(self.first), _count(self.second)

    def variances(self, count: int, length: float) -> Float[np.ndarray, " count"]:
        """Return the variances of the coefficients of a surface of variance one."""
        one, other = (_variances(f, length) for f in (self.first, self.second))
        found = np.outer(one, other).ravel()
        return np.pad(found, (0, count - len(found)))

    def basis(self, nodes: Nodes) -> Float[np.ndarray, "r k l p"]:
        """Return the contribution of each coefficient at the nodes, padded by zeros."""
        one, other = (_basis(f, nodes) for f in (self.first, self.second))
        every = one[..., :, None] * other[..., None, :]
        every = every.reshape(*every.shape[:-2], -1)
        return np.pad(every, [(0, 0)] * 3 + [(0, _WIDTH - every.shape[-1])])


class SurfaceLikelihood(NamedTuple):
    """The likelihood of the coefficients of a surface, all other parameters eliminated.

    `information` `(a, b, a, b)` and `slope` `(a, b)`, divided by the cost per sample;
    `rough`: the smoothness prior, with the predicted gain.
    """

    surface: Surface
    information: Float[np.ndarray, "a b a b"]
    slope: Float[np.ndarray, "a b"]
    rough: Roughness


def surfaces_of(families: Sequence[Family]) -> list[Surface]:
    """Return the surfaces of the arguments that may be combined."""
    alone = {
        f.argument: f
        for f in families
        if f.where is Where.FLIGHT and f.factor is Factor.ONE
    }
    return [
        Surface(alone[one], alone[other])
        for one, other in _COMBINED
        if one in alone and other in alone
    ]


def likelihood_of(nodes: Nodes, surface: Surface, policy: Policy) -> SurfaceLikelihood:
    """Return the likelihood of a surface about the point of a response."""
    quadratic = nodes.quadratic(surface.basis(nodes))
    # the last coefficients are padding
    rough = roughness(*quadratic, surface, np.zeros(_WIDTH), policy)
    inside, pull = beside(*quadratic, policy.distinct_information)
    used = int(np.prod(surface.shape))
    shape = surface.shape
    return SurfaceLikelihood(
        surface,
        inside[:used, :used].reshape(*shape, *shape),
        pull[:used].reshape(shape),
        rough,
    )


def _count(family: Family) -> int:
    return 1 + (_HARMONICS if family.periodic else _SINES)


def _variances(family: Family, length: float) -> np.ndarray:
    own = family.variances(_count(family) - 1, length)
    return np.append(own, float(family.jumps))


def _basis(family: Family, nodes: Nodes) -> Float[np.ndarray, "r k l p"]:
    at, _ = nodes.place(family)
    inside = np.clip(at, family.low, family.high)
    found = free_basis(family, inside.ravel(), _count(family))
    return found.reshape(*at.shape, -1)
