"""Find named terms that only imitate what else is missing.

If the fit is poor, the best of the known terms represents as much as it can of an
unknown effect. Such a term is hardly needed once a free function for that effect is
fitted as well.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...fitting import Fit
from ..policy import Policy
from ..search import Blocks, gain
from ._redrawn import lost_without


class Beside(NamedTuple):
    """The increases in the cost without a named term: as the fit is (`alone`), and if a
    structure of its residuals is fitted as well (`beside`).
    """

    alone: float
    beside: float

    def imitates(self, gain: float, policy: Policy) -> bool:
        """Return whether a structure explains more than the term, and all of what the
        term explains, except for an error of its form.

        **Arguments:** the `gain` of the structure in addition to the term.
        """
        allowed = policy.small * (gain + self.alone)
        return bool(gain > self.alone and self.beside < allowed)


def beside_structure(
    found: Fit,
    blocks: Blocks,
    free: np.ndarray,
    own: np.ndarray,
    parts: Mapping[str, Sequence[str]],
) -> dict[str, Beside]:
    """Return the losses without each of the named terms of a fit, according to the
    quadratic likelihood about it.

    **Arguments:** the fit; the likelihood, with the rows of the free parameters and of
    those of a structure; the parameters of each term.
    """
    information, score = blocks.total()
    names = found.problem.names
    values = np.asarray(found.point.values)
    value = np.zeros(len(blocks.names))
    for row in free:
        column = names.index(blocks.names[row])
        value[row] = values[blocks.owner[row], column] / blocks.scale[row]

    def lost(rows: np.ndarray, gone: np.ndarray) -> float:
        top = gain(information, score, rows)
        return lost_without(information, score, value, rows, gone, top)

    both = np.union1d(free, own)
    return {
        name: Beside(lost(free, gone), lost(both, gone))
        for name, gone in ((n, blocks.rows(each)) for n, each in parts.items())
    }
