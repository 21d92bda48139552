"""Special points between two points of a branch."""

from typing import NamedTuple

import numpy as np

from ._here import Here
from ._locate import locate, Located, pair_is_complex, Walk
from ._normal_forms import normal_form
from ._point import with_field
from ._program import evaluate
from ._test_functions import BRANCH_POINT


class Special(NamedTuple):
    """A special point to stand at, and what is known of it."""

    here: Here
    kind: str
    located: Located
    coefficient: float | None
    criticality: str


def sign_changes(walk: Walk, here: Here, there: Here) -> list[str]:
    """Names of the test functions that change sign on the way."""
    if not walk.settings.special:
        monitors = here.problem.monitors()
        watched = {k for k, monitor in monitors.items() if monitor.ends}
    else:
        watched = set(there.tests)
    found = []
    for name, after in there.tests.items():
        before = here.tests.get(name, 0.0)
        if name in watched and before * after < 0:
            found.append(name)
    return sorted(found, key=lambda name: name != BRANCH_POINT)


def located_between(
    walk: Walk, here: Here, there: Here, names: list[str]
) -> list[tuple[str, Located]]:
    """The zeros of these test functions in the order in which they are passed.

    Two functions with the same zero count once, unless a monitor ends the branch there.
    """
    monitors = here.problem.monitors()
    found: list[tuple[float, str, Located]] = []
    for name in names:
        values = (here.tests[name], there.tests[name])
        located = locate(here.problem, name, walk, here.at, there.at, values)
        way = (located.z - here.at.z) / here.at.scale
        same = [
            other
            for _, _, other in found
            if np.linalg.norm((located.z - other.z) / here.at.scale)
            < 1e-3 * np.linalg.norm((there.at.z - here.at.z) / here.at.scale)
            and other.converged
        ]
        if same and (name not in monitors or not monitors[name].ends):
            continue
        along = float(way @ (here.at.tangent / here.at.scale))
        found.append((along, name, located))
    found.sort(key=lambda item: item[0])
    return [(name, located) for _, name, located in found]


def special_here(
    walk: Walk, here: Here, chord: np.ndarray, name: str, located: Located
) -> Special | None:
    """Stand at a special point; None for a neutral saddle.

    `chord` points along the branch there.
    """
    problem = here.problem
    at = evaluate(problem, walk.leaf, located.z, chord, walk.width, walk.settings)
    if not np.all(np.isfinite(at.tangent)) or name == BRANCH_POINT:
        at = with_field(at, "tangent", chord / np.linalg.norm(chord / at.scale))
    monitors = problem.monitors()
    kind = monitors[name].kind if name in monitors else name
    if located.converged and name not in monitors:
        if not pair_is_complex(problem, kind, walk, located.z, at):
            return None
    coefficient, words = None, ""
    if name not in monitors and located.converged:
        coefficient, words = normal_form(
            kind, problem, walk.leaf, located.z, at, walk.settings
        )
    length = float(np.linalg.norm((located.z - here.at.z) / here.at.scale))
    there = Here(problem, at, {}, here.step, here.arclength + length, ())
    return Special(there, kind, located, coefficient, words)
