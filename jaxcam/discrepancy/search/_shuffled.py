"""Knockoff forces, which bound the rate at which forces are found by chance.

A knockoff has the same functions as a force that was found, but takes their arguments
at other moments of the same recording. It cannot be physics, so it explains only what
as many coefficients explain by chance.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...fitting import Problem
from ..policy import Policy
from ..terms import Bivariate, Where
from ._bivariate_likelihood import bivariate_at_nodes, Nodes
from ._free_fits import FreeFits, Missing
from ._heat import heat_of, heated
from ._local_force import force_response, forces_at_nodes, Response
from ._product_forms import form_at_nodes
from ._roughness import roughness
from ._slots import emptied, filled, Free, free_term


# Shortest and longest shift of a block, as a fraction of its recording
_SHIFTS = (0.1, 0.9)
# Number of blocks of a recording that are shifted separately
_BLOCKS = 8


class Shuffled(NamedTuple):
    """The gains of knockoffs of a function, relative to that of the function itself,
    the largest first.
    """

    label: str
    arguments: tuple[str, ...]
    shares: tuple[float, ...]

    @property
    def best(self) -> float:
        return self.shares[0]

    @property
    def by_chance(self) -> bool:
        """Return whether a knockoff explains as much as the function."""
        return self.best >= 1.0


def shuffled(
    fits: FreeFits, apart: Problem, found: Missing, policy: Policy, seed: int
) -> tuple[Shuffled, ...]:
    """Return the gains of knockoffs of each force of a fit.

    Forces that the recordings do not show to first order are left out.

    **Arguments:** `apart`: the problem with disconnected pieces; `seed` of the shifts.
    """
    compared = []
    for one in found.functions:
        if not isinstance(one, Free) or one.where is not Where.FLIGHT:
            continue
        # single pieces of flight contain little information on small forces
        problems = (apart,) if apart is found.problem else (apart, found.problem)
        for problem in problems:
            shares = _shares(fits, problem, found, one, policy, seed)
            if shares:
                compared.append(Shuffled(one.label, one.arguments, shares))
                break
    return tuple(compared)


def _shares(
    fits: FreeFits, problem: Problem, found: Missing, one: Free, policy: Policy, seed
) -> tuple[float, ...]:
    """Return the gains of knockoffs of one force, with the others in place, as
    fractions of its own; none if its own is not positive.
    """
    heat, point = heat_of(found.fit), found.fit.point
    others = [other for other in found.functions if other.slot != one.slot]
    problem = heated(filled(problem, others), heat)
    point = point._replace(values=emptied(problem, point.values, one.slot))
    response = force_response(problem, point, fits.rig)
    nodes = Nodes.of(problem, response, heat)
    forces = _functions(nodes, found, one)

    def gain(forces) -> float:
        zero = np.zeros(forces.shape[-1])
        quadratic = nodes.quadratic(forces)
        return max(roughness(*quadratic, one.prior, zero, policy).gain, 0.0)

    whole = gain(forces)
    if not whole > 0:
        return ()
    rng = np.random.default_rng(seed)
    knockoffs = (
        _at_other_moments(response, forces, rng) for _ in range(policy.knockoffs)
    )
    return tuple(sorted((gain(each) / whole for each in knockoffs), reverse=True))


def _functions(nodes: Nodes, found: Missing, one: Free) -> Float[np.ndarray, "r k l p"]:
    """Return the functions of which a force consists at the nodes of all pieces; those
    of a product have its second form as a factor.
    """
    if isinstance(one.prior, Bivariate):
        return bivariate_at_nodes(nodes, one.prior)
    term = free_term(one.family, "new")
    forces = forces_at_nodes(nodes.response, [term])
    if one.gate is None or one.primitive is None:
        return forces
    own = [found.fit[name].value for name in one.coefficients]
    numbers = np.array([1.0, *own[one.primitive.count :]])
    gate = form_at_nodes(nodes, one.gate.family, one.gate.primitive, numbers)
    return forces * gate[..., None]


def _at_other_moments(
    response: Response, forces: Float[np.ndarray, "r k l p"], rng: np.random.Generator
) -> Float[np.ndarray, "r k l p"]:
    """Return the forces of each recording, in blocks that are shifted in time."""
    found = forces.copy()
    for row, exists in enumerate(response.exists):
        rows = np.flatnonzero(exists)
        if not len(rows):
            # a recording without flights
            continue
        every = forces[row, rows]
        flat = every.reshape(-1, every.shape[-1])
        found[row, rows] = flat[_moments(len(flat), rng)].reshape(every.shape)
    return found


def _moments(count: int, rng: np.random.Generator) -> Int[np.ndarray, " n"]:
    """Return for each node of a recording the one whose arguments it takes."""
    cuts = np.sort(rng.integers(0, count, _BLOCKS - 1))
    low, high = _SHIFTS
    shifts = rng.integers(int(low * count), max(int(high * count), 1), _BLOCKS)
    block = np.searchsorted(cuts, np.arange(count), side="right")
    return (np.arange(count) + shifts[block]) % count
