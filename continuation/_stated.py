"""Convert a system and one of its orbits to a problem that `follow` can solve."""

from typing import Any

from .problem import AbstractProblem


def stated(problem: Any, start: Any) -> tuple[AbstractProblem, Any]:
    """Return the problem and its start, which are derived from a system and one of its
    orbits if these are given instead.
    """
    if isinstance(problem, AbstractProblem):
        return problem, start
    # imported here, so that other problems do not load the code for impacts
    from .orbits import start_of

    begun = start_of(problem, start)
    return begun.problem, begun
