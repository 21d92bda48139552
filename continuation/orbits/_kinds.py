"""Find a kind of orbits by name.

Branches of orbits with impacts continue as orbits that stick, and vice versa; with this
table, the module of the former need not import that of the latter.
"""

from collections.abc import Callable

from jaxcam.hybrid import HybridSystem

from ..problem import AbstractProblem


_KINDS: dict[str, Callable[[HybridSystem, int], AbstractProblem]] = {}


def add_kind(name: str, build: Callable[[HybridSystem, int], AbstractProblem]) -> None:
    """Add a kind: `build(system, periods)` returns the problem."""
    _KINDS[name] = build


def orbits_of_kind(name: str, system: HybridSystem, periods: int) -> AbstractProblem:
    """Return the problem of a kind of orbits."""
    return _KINDS[name](system, periods)
