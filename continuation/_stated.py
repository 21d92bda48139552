"""Convert a system and one of its orbits to a problem that `follow` can solve."""

from typing import Any

from .problem import AbstractProblem


def stated(problem: Any, start: Any) -> tuple[AbstractProblem, Any]:
    """Return the problem and its start; a system and one of its orbits may be given
    instead.
    """
    if isinstance(problem, AbstractProblem):
        return problem, start
    # the core imports the code for impacts only if a system has impacts
    from .orbits import start_of

    begun = start_of(problem, start)
    return begun.problem, begun
