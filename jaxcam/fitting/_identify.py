"""Analyse identifiability before any fit, and describe it in words."""

import dataclasses
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from ._fit import fit
from ._fit_result import Fit
from .engine import free_columns, linearised, Problem, sound_information


# a combination is identifiable if the data reduce its error to this fraction of the
# tolerance
_SEEN = 0.5
# A squared component of a direction that is below this may be due to rounding
_ROUNDING = 1e-12
# two relative changes that differ by less than this fraction count as equal
_SAME = 0.05
# members of a combination are named if they are at least this fraction of the largest
_MEMBER = 0.15


@dataclasses.dataclass(frozen=True)
class Identifiability:
    """Combinations of parameters, ordered by how well the data determine them.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Examples:
        >>> from jaxcam.fitting import identify
        >>> identify(problem).seen
        1
    """

    names: tuple[str, ...]
    """Names of the parameters."""
    directions: Float[np.ndarray, "g g"]
    """Combinations, one per row, each parameter in units of its scale, shape `(g, g)`.
    """
    stderr: Float[np.ndarray, " g"]
    """Standard error of each combination from the data alone, in the units of
    `directions`.
    """
    values: Float[np.ndarray, " g"]
    """Parameter values at which the analysis was made."""
    scales: Float[np.ndarray, " g"]
    """Scale of each parameter."""
    alone: Float[np.ndarray, " g"]
    """Standard error of each parameter from the data alone if all others are known, in
    units of the scale.
    """
    together: Float[np.ndarray, " g"]
    """Standard error of each parameter from the data alone if no other is known, in
    units of the scale.
    """
    lost: tuple[str, ...] = ()
    """Recordings that are not counted, because their information is lost to rounding.
    """

    @property
    def seen(self) -> int:
        """Number of combinations that the data determine to within half their
        tolerance.
        """
        return int(np.sum(self.stderr < _SEEN))

    def sentences(self) -> list[str]:
        """Return the result in words, one fact per sentence."""
        total = len(self.names)
        if not total:
            return ["There is nothing to fit."]
        found = [
            f"The data determine {self.seen} of {total} combinations of parameters to "
            "within half their tolerance."
        ]
        if self.lost:
            found.append(
                f"At the nominal parameters, the motion in {_listed(self.lost)} is so "
                f"sensitive that rounding errors exceed the information, so "
                f"{'it is' if len(self.lost) == 1 else 'they are'} not counted here."
            )
        dead = [n for n, a in zip(self.names, self.alone) if not np.isfinite(a)]
        if dead and len(self.lost) == 0:
            found.append(
                f"The data do not depend on {_listed(dead)} at all: fix "
                f"{'it' if len(dead) == 1 else 'them'}."
            )
        alone = [
            n
            for n, a, t in zip(self.names, self.alone, self.together)
            if t < _SEEN and np.isfinite(a)
        ]
        if alone:
            found.append(f"Separately identifiable: {_listed(alone)}.")
        for stderr, direction in zip(self.stderr[::-1], self.directions[::-1]):
            members = self._members(direction)
            if stderr < _SEEN or not members or set(members) <= set(dead):
                continue
            found.append(self._unseen(stderr, direction, members))
        return found

    def _members(self, direction) -> list[str]:
        large = np.max(np.abs(direction))
        order = np.argsort(-np.abs(direction))
        return [self.names[k] for k in order if abs(direction[k]) >= _MEMBER * large]

    def _unseen(self, stderr, direction, members) -> str:
        if len(members) == 1:
            return (
                f"The data constrain {members[0]} less than its tolerance does, so its "
                f"value is set by the tolerance."
            )
        shares = {self.names[k]: direction[k] for k in range(len(self.names))}
        sign = np.sign(shares[members[0]])
        up = [n for n in members if shares[n] * sign > 0]
        down = [n for n in members if shares[n] * sign < 0]
        what = f"increasing {_listed(up)} together"
        if len(up) == 1:
            what = f"increasing {up[0]}"
        if down:
            what += f" while decreasing {_listed(down)}"
        what += self._relation(direction, members)
        return (
            f"The data are almost insensitive to {what}; the tolerances determine this "
            "combination."
        )

    def _relation(self, direction, members) -> str:
        """Describe the relation of two parameters that are only determined together."""
        pair = [self.names.index(name) for name in members]
        if len(pair) != 2 or np.any(self.values[pair] == 0):
            return ""
        one, other = direction[pair] * self.scales[pair] / self.values[pair]
        if abs(one - other) < _SAME * abs(one):
            return " (only their ratio matters)"
        if abs(one + other) < _SAME * abs(one):
            return " (only their product matters)"
        return ""


def identify(
    problem: Problem, names: Iterable[str] | None = None, at: Fit | None = None
) -> Identifiability:
    """Analyse which parameters the recordings can determine, without a parameter fit.

    The analysis uses the Fisher information at the nominal parameters, with the states
    of all pieces eliminated. Its large eigenvalues belong to combinations that the data
    determine, its small ones to those that only the tolerances constrain. The example
    continues the one in [`jaxcam.fitting.fit`][].

    Args:
        problem: The problem.
        names: Names of the parameters; default: all.
        at: The fit at which to evaluate; default: the nominal parameters with the
            states fitted.

    Returns:
        An [`jaxcam.fitting.Identifiability`][].

    Raises:
        ValueError: A name is unknown.

    Examples:
        >>> from jaxcam.fitting import identify
        >>> identify(problem).names
        ('gravity',)
    """
    columns = free_columns(problem, names)
    at = at or fit(problem, free=())
    blocks, _ = linearised(problem, columns, problem.extras, at.point)
    information, lost = sound_information(columns, blocks)
    if not np.all(np.isfinite(information)):
        raise ValueError(
            "The sensitivities of the model to its parameters are not finite; check "
            "the units of the columns and the nominal parameters, and for NaN in the "
            "vector field, gap and impact."
        )
    values, vectors = np.linalg.eigh(information)
    # eigenvalues that are zero to within rounding are set to zero
    floor = np.finfo(float).eps * len(values) * max(np.max(values, initial=0.0), 0.0)
    values = np.where(values > floor, values, 0.0)[::-1]
    directions = vectors.T[::-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        stderr = 1 / np.sqrt(values)
        alone = 1 / np.sqrt(np.maximum(np.diag(information), 0.0))
        # a direction without information is itself accurate only to rounding, so its
        # smallest components are set to zero
        dead = ~np.isfinite(stderr)[:, None]
        spread = np.where(dead & (directions**2 < _ROUNDING), 0.0, directions**2)
        weighted = np.where(spread > 0, spread * stderr[:, None] ** 2, 0.0)
        together = np.sqrt(np.sum(weighted, axis=0))
    held = np.asarray(at.point.values)[np.maximum(columns.record, 0), columns.parameter]
    return Identifiability(
        columns.labels(problem),
        directions,
        stderr,
        held,
        columns.scale,
        alone,
        together,
        tuple(problem.records[k] for k in lost),
    )


def _listed(names) -> str:
    names = list(names)
    if len(names) == 1:
        return names[0]
    return f"{', '.join(names[:-1])} and {names[-1]}"
