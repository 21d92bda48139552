"""Eliminate the states of a recording, piece by piece, from a quadratic likelihood."""

from collections.abc import Callable, Sequence

import numpy as np


# Relative increase of a diagonal that keeps a matrix positive definite
_STATES = 1e-13
TINY = 1e-300
"""Lower limit of divisors that may be zero."""


class StateElimination:
    """The states of one recording, eliminated from its first piece to its last.

    The blocks of a piece are the information of its state with itself and with the
    parameters, its score, and its information with the forces. Rows that connect two
    pieces have three parts, in this order: derivatives with respect to the parameters,
    residuals, and derivatives with respect to the forces.

    **Arguments:** `add(direct, pushed, off, sign)` collects rows without a state:
    derivatives with respect to the parameters and to the forces, and the residuals.
    """

    def __init__(self, add: Callable[..., None]):
        self._add = add
        self._blocks: list[np.ndarray] = []

    def begin(self, blocks: Sequence[np.ndarray]) -> None:
        """Start with the blocks of the first piece."""
        self._blocks = list(blocks)

    def follow(self, blocks: Sequence[np.ndarray], earlier, later, rows) -> None:
        """Continue with the next piece; `rows` connect it to the previous state.

        **Arguments:** the blocks of the next piece; derivatives of the rows with
        respect to the previous state and to the state of the next piece; the three
        parts of the rows.
        """
        direct, off, pushed = rows
        self._add(direct, pushed, off, 1.0)
        here = [x + later.T @ y for x, y in zip(blocks, (later, *rows))]
        before = [x + earlier.T @ y for x, y in zip(self._blocks, (earlier, *rows))]
        taken = self._taken(before, earlier.T @ later)
        self._blocks = [x - taken[0].T @ y for x, y in zip(here, taken)]

    def end(self) -> None:
        """Eliminate the state of the last piece, if there is one."""
        if self._blocks:
            self._taken(self._blocks, np.zeros((len(self._blocks[0]), 0)))

    def _taken(self, blocks, coupling):
        """Eliminate a state: add its contribution with a negative sign, and return its
        coupling and blocks, divided by the square root of its information.
        """
        scale = 1 / np.sqrt(np.maximum(np.diag(blocks[0]), TINY))
        scaled = blocks[0] * np.outer(scale, scale)
        root = np.linalg.inv(np.linalg.cholesky(scaled + _STATES * np.eye(len(scale))))
        root = root * scale
        direct, off, pushed = (root @ part for part in blocks[1:])
        self._add(direct, pushed, off, -1.0)
        return root @ coupling, direct, off, pushed
