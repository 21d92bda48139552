"""A piecewise-linear mechanical system with harmonic forces, and its modes.

With the state x and z = (x, 1, cos, sin) of the forcing, the system is

    x' = A z + sum_k s_k b_k (r_k z),

where s_k = +-1 is the side of surface k, on which c_k z = 0, b_k a direction and r_k z
the size of the change. While the motion slides on surface k, the term of this surface
is b_k p_k, where p_k keeps c_k z at zero; it may be at most `holding` r_k z in size.
While a constraint is in contact, a multiplier times the direction w_j keeps its gap at
zero. All multipliers are linear in z, and so is every condition that ends a mode. This
module does not use jaxcam.
"""

from typing import NamedTuple

import numpy as np


class Mode(NamedTuple):
    """Sides of the surfaces, surfaces on which the motion slides, and contacts."""

    sides: tuple[int, ...]
    sliding: tuple[bool, ...]
    contact: tuple[bool, ...]


class Linear(NamedTuple):
    """The system: K surfaces, m gaps, n states, N = n + 3."""

    omega: float
    phase: float
    # A, shape (n, N)
    field: np.ndarray
    # c, shape (K, N); b, (K, n); r, (K, N)
    rows: np.ndarray
    kicks: np.ndarray
    loads: np.ndarray
    width: np.ndarray
    holding: np.ndarray
    # whether the motion can slide on each surface
    slidable: tuple[bool, ...]
    # gaps, shape (m, N); w, shape (m, n); coefficients of restitution
    gaps: np.ndarray
    normals: np.ndarray
    restitution: np.ndarray
    # friction coefficient of contact 0 against the slip of surface 0, or 0 if none
    rubs: float = 0.0

    def extended(self, x, t: float) -> np.ndarray:
        """The vector z of a state at a time."""
        angle = self.omega * t + self.phase
        return np.concatenate([x, [1.0, np.cos(angle), np.sin(angle)]])

    def speed_rows(self) -> np.ndarray:
        """The rates of the gaps as rows; no force changes a position at once."""
        return self.gaps @ self.whole(self.field)

    def whole(self, field) -> np.ndarray:
        """The matrix of z' = M z for a field of shape (n, N)."""
        n = len(field)
        matrix = np.zeros((n + 3, n + 3))
        matrix[:n] = field
        matrix[n + 1, n + 2], matrix[n + 2, n + 1] = -self.omega, self.omega
        return matrix


class Law(NamedTuple):
    """One mode: z' = `matrix` z as long as all `guards` z are positive."""

    matrix: np.ndarray
    guards: np.ndarray
    # name of each guard: ("side", k), ("upper", k), ("lower", k), ("gap", j) or
    # ("force", j)
    names: list[tuple[str, int]]
    # needed term p_k of each sliding surface, and its largest size, as rows
    needed: dict[int, np.ndarray]
    limit: dict[int, np.ndarray]


def law(system: Linear, mode: Mode) -> Law:
    """The matrix and the guards of a mode."""
    n, size = system.field.shape
    sliding = [k for k, on in enumerate(mode.sliding) if on]
    contact = [j for j, on in enumerate(mode.contact) if on]
    field = system.field.copy()
    for k, side in enumerate(mode.sides):
        if not mode.sliding[k]:
            field += side * np.outer(system.kicks[k], system.loads[k])
    columns = [system.normals[j].copy() for j in contact]
    if system.rubs and contact and not mode.sliding[0]:
        columns[0] += mode.sides[0] * system.rubs * system.kicks[0]
    columns += [system.kicks[k] for k in sliding]
    solved = np.zeros((0, size))
    if columns:
        ways = np.zeros((size, len(columns)))
        ways[:n] = np.array(columns).T
        speeds = system.speed_rows()
        held = np.array(
            [speeds[j] for j in contact] + [system.rows[k] for k in sliding]
        )
        solved = np.linalg.solve(held @ ways, -held @ system.whole(field))
        field = field + ways[:n] @ solved
    forces = dict(zip(contact, solved, strict=False))
    needed = dict(zip(sliding, solved[len(contact) :], strict=True))
    limit, one = {}, np.eye(size)[n]
    guards, names = [], []
    for k, side in enumerate(mode.sides):
        if mode.sliding[k]:
            load = system.loads[k]
            if system.rubs and k == 0:
                load = system.rubs * forces[0] if 0 in forces else 0 * load
            limit[k] = system.holding[k] * load
            guards += [limit[k] - needed[k], limit[k] + needed[k]]
            names += [("upper", k), ("lower", k)]
        else:
            guards.append(side * system.rows[k] + system.width[k] * one)
            names.append(("side", k))
    for j, on in enumerate(mode.contact):
        guards.append(forces[j] if on else system.gaps[j])
        names.append(("force" if on else "gap", j))
    return Law(system.whole(field), np.array(guards), names, needed, limit)
