"""Which parameters vary, in a form that other processes understand."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.tree_util import DictKey, FlattenedIndexKey, GetAttrKey, keystr, SequenceKey


@dataclass(frozen=True)
class Pick:
    """A `where` function without code: the paths of one parameter or several."""

    paths: tuple[tuple[Any, ...], ...]
    several: bool = False

    def __call__(self, system):
        leaves = tuple(_follow(system, path) for path in self.paths)
        return leaves if self.several else leaves[0]

    @property
    def names(self) -> tuple[str, ...]:
        """`speed`, `profile.radius`, ..."""
        return tuple(keystr(path, simple=True, separator=".") for path in self.paths)


def pick(where: Callable | str | tuple, system) -> Pick:
    """The `Pick` of a name (`"profile.radius"`), a function, or a tuple of those.

    **Raises:** `ValueError` where that is not a floating-point parameter.
    """
    if isinstance(where, Pick):
        return where
    parts = where if isinstance(where, tuple) else (where,)
    paths = []
    for part in parts:
        found = _paths(part, system)
        paths += found
        if isinstance(where, tuple) and len(found) != 1:
            raise ValueError(
                "where is a tuple of functions that pick several parameters each; let "
                "each pick one"
            )
    return Pick(tuple(paths), isinstance(where, tuple) or len(paths) > 1)


def _paths(where: Callable | str, system) -> list[tuple]:
    if isinstance(where, str):
        found, _ = jax.tree_util.tree_flatten_with_path(system)
        paths = {keystr(p, simple=True, separator="."): p for p, _ in found}
        if where not in paths:
            raise ValueError(
                f"there is no parameter {where!r}; they are "
                f"{', '.join(parameter_names(system))}"
            )
        return _numbers(system, [(paths[where], _follow(system, paths[where]))])
    nothing = jax.tree.map(lambda _: False, system)
    try:
        marked = eqx.tree_at(where, nothing, replace_fn=lambda _: True)
    except (AttributeError, KeyError, IndexError, TypeError, ValueError) as error:
        raise ValueError(
            f"where does not pick a parameter of {type(system).__name__} ({error}); "
            f"they are {', '.join(parameter_names(system))}"
        ) from None
    flags, _ = jax.tree_util.tree_flatten_with_path(marked)
    leaves = jax.tree.leaves(system)
    chosen = [
        (path, leaf) for (path, flag), leaf in zip(flags, leaves, strict=True) if flag
    ]
    return _numbers(system, chosen)


def _numbers(system, chosen) -> list[tuple]:
    for path, leaf in chosen:
        if not _is_number(leaf) or jnp.ndim(leaf) != 0:
            raise ValueError(
                f"{keystr(path).lstrip('.')} is not a number that could vary; the "
                f"parameters are {', '.join(parameter_names(system))}"
            )
    return [path for path, _ in chosen]


def parameter_names(system) -> list[str]:
    """Names of all the numbers of a system that can vary."""
    found, _ = jax.tree_util.tree_flatten_with_path(system)
    return [
        keystr(path, simple=True, separator=".")
        for path, leaf in found
        if _is_number(leaf) and jnp.ndim(leaf) == 0
    ]


def _is_number(leaf) -> bool:
    return type(leaf) is float or eqx.is_inexact_array_like(leaf)


def _follow(tree, path):
    for key in path:
        if isinstance(key, GetAttrKey):
            tree = getattr(tree, key.name)
        elif isinstance(key, DictKey | FlattenedIndexKey):
            tree = tree[key.key]
        else:
            assert isinstance(key, SequenceKey)
            tree = tree[key.idx]
    return tree
