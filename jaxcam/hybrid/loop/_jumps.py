"""Find which components of the rates change at each switching surface."""

from typing import no_type_check

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import Literal

from .._switched import SwitchedSystem
from ..lowering import scalarise, split
from ..surface import has_friction, Jumps, surfaces


def jumping_components(
    system: SwitchedSystem, shapes, time, state, number: int
) -> Jumps:
    """Return, for each surface, the components of the rates that its side changes.

    Without contacts, only the branch changes with the side; in contact, friction also
    does. The components are found from the traced programs of both, scalar by scalar.
    If the switching function of a surface depends on none of these components, none is
    returned for this surface: the motion crosses the surface at the same speed on both
    sides and cannot slide along it. An example is a stop at a position, which changes a
    force. A motion also never slides at a transition between modes.

    Args:
        system: The system; only its structure matters.
        shapes: Shapes of its parameters, a pytree of `jax.ShapeDtypeStruct`.
        time: Shape of the time.
        state: Shape of the state.
        number: Number of surfaces, k.

    Returns:
        The components, with and without contacts.
    """
    _, static = eqx.partition(system, eqx.is_inexact_array)
    k, n = number, state.shape[0]

    def branch(p, t, x, sides):
        return eqx.combine(p, static).branch(t, x, sides)

    def friction(p, t, x, sides):
        rows = eqx.combine(p, static).contact_friction(t, x, sides)
        return jnp.sum(jnp.atleast_2d(rows), axis=0)

    def switching(p, t, x):
        return surfaces(eqx.combine(p, static), t, x)

    sides = jax.ShapeDtypeStruct((k,), np.float64)
    free = by_side = _dependence(branch, (shapes, time, state, sides), k)
    if has_friction(system):
        more = _dependence(friction, (shapes, time, state, sides), k)
        by_side = [a | b for a, b in zip(by_side, more, strict=True)]
    by_state = _dependence(switching, (shapes, time, state), n)

    def changed(sets):
        found = [[i for i in range(n) if k in sets[i]] for k in range(number)]
        return tuple(
            tuple(own) if k >= system.one_way and set(own) & by_state[k] else ()
            for k, own in enumerate(found)
        )

    return Jumps(changed(by_side), changed(free))


@no_type_check
def _dependence(function, example, last: int) -> list[set[int]]:
    """Return for each component of the result on which components of the last argument
    it depends.
    """
    scalar = scalarise(function, *example)
    *rest, vector = example
    flat, structure = jax.tree.flatten(rest)

    def call(leaves, scalars):
        others = jax.tree.unflatten(structure, [split(leaf) for leaf in leaves])
        return list(scalar(*others, _packed(scalars)))

    one = jax.ShapeDtypeStruct((), vector.dtype)
    closed = jax.make_jaxpr(call)(flat, [one] * last)
    jaxpr = closed.jaxpr
    first = len(jaxpr.invars) - last
    known = {v: {i} for i, v in enumerate(jaxpr.invars[first:])}

    def of(v):
        return set() if isinstance(v, Literal) else known.get(v, set())

    for equation in jaxpr.eqns:
        found = set().union(*(of(v) for v in equation.invars))
        for v in equation.outvars:
            known[v] = found
    return [of(v) for v in jaxpr.outvars]


def _packed(scalars) -> np.ndarray:
    out = np.empty(len(scalars), dtype=object)
    for i, s in enumerate(scalars):
        out[i] = s
    return out
