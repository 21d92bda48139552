"""Look up the continuation problem for a kind of orbit by name.

Branches of orbits with impacts continue as orbits that stick, and vice versa; with this
table, the module for orbits with impacts need not import the one for orbits that stick.
"""

from collections.abc import Callable

from jaxcam.hybrid import HybridSystem

from ..problem import AbstractProblem


_KINDS: dict[str, Callable[[HybridSystem, int], AbstractProblem]] = {}


def add_kind(name: str, build: Callable[[HybridSystem, int], AbstractProblem]) -> None:
    """Add a kind of orbit; `build(system, periods)` must return its problem."""
    _KINDS[name] = build


def orbits_of_kind(name: str, system: HybridSystem, periods: int) -> AbstractProblem:
    """Return the continuation problem for the kind of orbit with this name."""
    return _KINDS[name](system, periods)
