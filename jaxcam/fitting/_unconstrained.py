"""Find combinations of parameters that the data do not constrain."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float


# Fractions of the largest singular value (of a Jacobian with columns of unit length)
# below which the information on a combination is certainly, or possibly, due to
# rounding
_BLIND, _DOUBTFUL = 4e-6, 3e-3
# A combination whose information grows by more than this factor if the eliminated
# states are regularised a hundred times as strongly is not determined by the data
_GROWS = 10.0
# Members of a combination are named if they are at least this fraction of the largest
_MEMBER = 0.1


@dataclasses.dataclass(frozen=True)
class Unconstrained:
    """A combination of parameters whose change does not affect the predicted data."""

    names: tuple[str, ...]
    """Names of the parameters; `name@record` if each recording has its own value."""
    shares: Float[np.ndarray, " k"]
    """Change of each parameter in its unit; the largest change equals the parameter's
    scale.
    """

    def sentence(self) -> str:
        """Return the combination, and how to determine it, in words."""
        if len(self.names) == 1:
            return (
                f"The data do not constrain {self.names[0]}; fix it or give it a "
                f"(smaller) tolerance."
            )
        moves = ", ".join(
            f"{name} by {share:+.3g}" for name, share in zip(self.names, self.shares)
        )
        return (
            f"A joint change of {moves} does not affect the data; fix one of them or "
            f"give it a (smaller) tolerance."
        )


def unconstrained(
    labels: Sequence[str],
    information: Float[np.ndarray, "g g"],
    scale: Float[np.ndarray, " g"],
    firmer: Callable[[], Float[np.ndarray, "g g"]],
) -> tuple[Unconstrained, ...]:
    """Find unconstrained combinations of parameters from the Jacobian of the data.

    Unconstrained combinations are right singular vectors of the Jacobian J with nearly
    zero singular values. They are found as eigenvectors of the information J^T J, whose
    eigenvalues are the squares of the singular values of J. The columns of J are first
    scaled to unit length.

    **Arguments:** names and `information` of the parameters in units of their `scale`;
    `firmer` returns the same matrix with a stronger regularisation of the eliminated
    states.
    """
    diagonal = np.diag(information)
    dead = ~(diagonal > 0)
    found = [
        Unconstrained((labels[k],), scale[k : k + 1])
        for k in np.flatnonzero(dead).tolist()
    ]
    rows = np.flatnonzero(~dead)
    if len(rows):
        unit = 1 / np.sqrt(diagonal[rows])
        inner = information[np.ix_(rows, rows)] * np.outer(unit, unit)
        values, vectors = np.linalg.eigh(inner)
        doubtful = values[0] <= _DOUBTFUL**2 * values[-1]
        held = (
            firmer()[np.ix_(rows, rows)] * np.outer(unit, unit) if doubtful else inner
        )
        for value, vector in zip(values, vectors.T):
            rounding = value <= _BLIND**2 * len(rows) * values[-1]
            # a state determined only by rounding errors appears to provide information
            lent = vector @ held @ vector > _GROWS * max(value, 0.0)
            if not (rounding or (value <= _DOUBTFUL**2 * values[-1] and lent)):
                continue
            moves = vector * unit
            large = np.abs(moves) >= _MEMBER * np.max(np.abs(moves))
            order = np.flatnonzero(large)
            order = order[np.argsort(-np.abs(moves[order]))]
            moves = moves / np.max(np.abs(moves))
            found.append(
                Unconstrained(
                    tuple(labels[int(k)] for k in rows[order]),
                    moves[order] * scale[rows[order]],
                )
            )
    return tuple(found)
