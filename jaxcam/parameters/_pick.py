"""Select the parameters to vary by a function or by a dotted name."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.tree_util import keystr, tree_flatten_with_path
from jaxtyping import PyTree


_Tree = TypeVar("_Tree")


class _Marker:
    """Stands in for a leaf while `where` runs."""

    def __init__(self, index: int):
        self.index = index


@dataclass(frozen=True)
class Pick:
    """The parameters selected by a `where` argument, stored by their positions in the
    tree.

    A `Pick` can be hashed, compared, and sent to another process. Called with a tree of
    the same structure, it returns the leaf, or a tuple of leaves if `several` is set.
    It can therefore be used wherever equinox takes a `where`.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.parameters import pick
        >>> float(pick("gravity", BouncingBall())(BouncingBall(gravity=1.6)))
        1.6
    """

    leaves: tuple[int, ...]
    """Positions of the selected parameters among the leaves of the tree."""
    names: tuple[str, ...]
    """Dotted names of the selected parameters, such as `speed`, `profile.radius`."""
    several: bool = False
    """Whether a call returns a tuple."""

    def __call__(self, tree: PyTree) -> Any:
        flat = jax.tree.leaves(tree)
        found = tuple(flat[i] for i in self.leaves)
        return found if self.several else found[0]

    def replaced(self, tree: _Tree, *values: Any) -> _Tree:
        """Return the tree with one new value for each parameter."""
        flat, structure = jax.tree.flatten(tree)
        for i, value in zip(self.leaves, values, strict=True):
            flat[i] = value
        return jax.tree.unflatten(structure, flat)


Where = Callable[[Any], Any] | str | tuple[Callable[[Any], Any] | str, ...] | Pick
"""Selects one or more parameters: a function of the system, a dotted name, a tuple of
these, or a `Pick`.
"""


def pick(
    where: Where,
    tree: PyTree,
    *,
    integers: bool = False,
) -> Pick:
    """Return the parameters of `tree` selected by `where`.

    Args:
        where: A function of the tree (`lambda system: system.speed`), a dotted name
            (`"profile.radius"`) or the end of one if no other name ends like it
            (`"radius"`), or a tuple of those. A function may return several parameters
            at once.
        tree: A system, or any other pytree with numbers among its leaves.
        integers: Whether integers may vary too; default: floating-point numbers only.

    Returns:
        A [`jaxcam.parameters.Pick`][].

    Raises:
        ValueError: A parameter does not exist or is not a single number.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.parameters import pick
        >>> pick("restitution", BouncingBall()).names
        ('restitution',)
    """
    if isinstance(where, Pick):
        return where
    parts = where if isinstance(where, tuple) else (where,)
    found = [_places(part, tree, integers) for part in parts]
    if isinstance(where, tuple) and any(len(places) != 1 for places in found):
        raise ValueError(
            "where is a tuple of functions, of which at least one selects several "
            "parameters; let each select only one"
        )
    places = tuple(place for some in found for place in some)
    named = _named_leaves(tree)
    for place in places:
        name, leaf = named[place]
        if not _varies(leaf, integers):
            raise ValueError(
                f"{name} is not one number that can vary; {_known(tree, integers)}"
            )
    several = isinstance(where, tuple) or len(places) > 1
    return Pick(places, tuple(named[place][0] for place in places), several)


def unit_tangent(where: Where, tree: _Tree) -> _Tree:
    """Return the unit tangent along one parameter, for `equinox.filter_jvp`.

    Args:
        where: Selects a parameter of the system: `lambda s: s.speed`, or its dotted
            name.
        tree: A system, or any other pytree.

    Returns:
        Zeros for every floating-point array of the tree, 1 for the parameter selected
            by `where`, and `None` for all other leaves.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.parameters import unit_tangent
        >>> float(unit_tangent("gravity", BouncingBall()).gravity)
        1.0
    """
    picked = pick(where, tree)
    zeros = jax.tree.map(jnp.zeros_like, eqx.filter(tree, eqx.is_inexact_array))
    # the tree of arrays has fewer leaves, so the parameter has another index in it
    along = pick(picked.names[0], zeros)
    return along.replaced(zeros, jnp.ones_like(picked(tree)))


def parameter_names(tree: PyTree, *, integers: bool = False) -> list[str]:
    """Return the dotted names of all numbers in a tree that can vary.

    Args:
        tree: A system, or any other pytree.
        integers: Whether to include integers; default: floating-point numbers only.

    Returns:
        A list of names.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.parameters import parameter_names
        >>> parameter_names(BouncingBall())
        ['gravity', 'restitution', 'amplitude', 'frequency']
    """
    return [name for name, leaf in _named_leaves(tree) if _varies(leaf, integers)]


def _places(where: Callable | str, tree, integers) -> tuple[int, ...]:
    """Return the indices of the leaves selected by a function or name."""
    if isinstance(where, str):
        names = [name for name, _ in _named_leaves(tree)]
        # a name may be written in Python syntax: terms[0].c1
        name = re.sub(r"\[['\"]?(\w+)['\"]?\]", r".\1", where).lstrip(".")
        ends = [one for one in names if one.endswith(f".{name}")]
        if name not in names and len(ends) == 1:
            (name,) = ends
        if name not in names:
            raise ValueError(
                f"there is no parameter {where!r}; {_known(tree, integers)}"
            )
        return (names.index(name),)
    flat, structure = jax.tree.flatten(tree)
    marked = jax.tree.unflatten(structure, [_Marker(i) for i in range(len(flat))])
    try:
        made = where(marked)
    except (AttributeError, KeyError, IndexError, TypeError) as error:
        raise ValueError(
            f"where selects a parameter that does not exist ({error}); "
            f"{_known(tree, integers)}"
        ) from error
    made = tuple(made) if isinstance(made, tuple | list) else (made,)
    if not made or not all(isinstance(one, _Marker) for one in made):
        raise ValueError(
            "where must select parameters as they are, as in `lambda system: "
            f"system.speed`; {_known(tree, integers)}"
        )
    return tuple(one.index for one in made)


def _known(tree, integers) -> str:
    names = ", ".join(parameter_names(tree, integers=integers)) or "none"
    return f"the parameters are: {names}"


def _named_leaves(tree) -> list[tuple[str, Any]]:
    pairs, _ = tree_flatten_with_path(tree)
    return [
        (keystr(path, simple=True, separator=".") or "parameter", leaf)
        for path, leaf in pairs
    ]


def _varies(leaf, integers: bool) -> bool:
    """Return whether a leaf is a single number that can vary."""
    if isinstance(leaf, bool):
        return False
    if isinstance(leaf, float | np.floating):
        return True
    if isinstance(leaf, int | np.integer):
        return integers
    if not isinstance(leaf, jax.Array | np.ndarray) or leaf.shape != ():
        return False
    kinds = np.number if integers else np.floating
    return bool(jnp.issubdtype(leaf.dtype, kinds))
