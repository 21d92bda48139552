"""Whether a branch has come back to its start."""

import numpy as np

from ._here import Here, stand
from ._locate import Walk
from ._program import correct, Corrected, evaluate


def closed(
    walk: Walk, origin: Corrected | None, here: Here, there: Here
) -> Here | None:
    """The start of the branch, where this step came back to it."""
    if origin is None or origin.z.shape != here.at.z.shape:
        return None
    scale = here.at.scale
    start, a, b = origin.z / scale, here.at.z / scale, there.at.z / scale
    chord = b - a
    length = np.linalg.norm(chord)
    along = float((start - a) @ chord) / length
    aside = np.linalg.norm(start - a - along / length * chord)
    if here.arclength < 3 * length or not 0 < along <= length or aside > length:
        return None
    tangent = origin.tangent / scale
    if float(tangent @ chord) < 0.5 * length * np.linalg.norm(tangent):
        return None
    guess = (a + along / length * chord) * scale
    at = correct(
        here.problem, walk.leaf, guess, chord / length / scale, chord * scale,
        walk.width, walk.settings,
    )  # fmt: skip
    miss = np.linalg.norm(at.z / scale - start)
    # points of a branch are a square root of the tolerance apart at most, where
    # they are the same
    if not at.success or miss > np.sqrt(walk.settings.tolerance) + 1e-6:
        return None
    back = evaluate(
        here.problem, walk.leaf, origin.z, origin.tangent, walk.width, walk.settings
    )
    return stand(
        here.problem, back, here.step, here.arclength + float(along), here.trail
    )
