"""Measure how much of a Bouc-Wen force the hysteresis of the library can represent.

Along the true motion of `_textbook_cases.py`, the internal state of a hysteresis is
integrated for a grid of parameters, and its force is fitted together with a constant, a
stiffness and a damping. The best point of the grid is then improved by the Nelder-Mead
method. For both kinds of hysteresis that a diagnosis tries, the script prints the rms
of the remaining part of the force that no linear oscillator has, as a fraction of the
rms of that force.

    python -m benchmarks.textbook_hysteresis bouc_wen
"""

import argparse

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize

from benchmarks._textbook_cases import CASES, extra_force, moved, multisine
from jaxcam.discrepancy.search._hidden_kinds import HYSTERESIS, STIFFENING


# Points of the motion per sample
_FINE = 4


def states(deflection, loading, unloading, power) -> np.ndarray:
    """Internal states `(n, k)` in the second period of a deflection.

    The rate is that of the deflection times `1 - c |z|^power`, with the coefficient c
    of loading or of unloading.
    """
    change = np.diff(np.concatenate([deflection, deflection]))
    z, found = np.zeros(len(loading)), []

    def slope(z, step):
        c = np.where(z * np.sign(step) > 0, loading, unloading)
        return 1 - c * np.maximum(np.abs(z), 1e-12) ** power

    for step in change:
        middle = z + step / 2 * slope(z, step)
        z = np.clip(z + step * slope(middle, step), -50, 50)
        found.append(z)
    return np.array(found[len(deflection) - 1 :])


def remaining(case, motion, loading, unloading, power) -> np.ndarray:
    """Rms of the force that remains, as a fraction of that of the extra force."""
    x, v = motion.states[:, 0], motion.states[:, 1]
    force = case.force(x, v, motion.states[:, 2])
    count = _FINE * (len(x) - 1) + 1
    fine = np.linspace(motion.time[0], motion.time[-1], count)
    path = CubicHermiteSpline(motion.time, x, v)(fine) / np.max(np.abs(x))
    every = states(path, loading, unloading, power)[::_FINE]
    size = np.std(extra_force(case, motion))
    left = []
    for z in every.T:
        basis = np.stack([z, np.ones(len(x)), x, v], axis=1)
        basis = basis / np.linalg.norm(basis, axis=0)
        found = basis @ np.linalg.lstsq(basis, force, rcond=None)[0]
        left.append(np.std(force - found) / size)
    return np.array(left)


def _grid(*axes) -> np.ndarray:
    return np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(axes), -1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = [name for name, case in CASES.items() if case.memory is not None]
    parser.add_argument("case", choices=names)
    parser.add_argument("--seed", type=int, default=1, help="of the input")
    args = parser.parse_args()
    case, rng = CASES[args.case], np.random.default_rng(args.seed)
    motion = moved(case, multisine(case, 1.0, rng))
    for kind, limits, betas in (
        (HYSTERESIS, np.geomspace(0.05, 20, 14), np.linspace(0.5, 1.5, 5)),
        (STIFFENING, np.geomspace(0.05, 20, 14), np.linspace(-6, 0, 13)),
    ):
        sign = 1 if kind is HYSTERESIS else -1

        def left(limit, beta, n, sign=sign):
            loading = sign * np.asarray(limit) ** -n
            return remaining(case, motion, loading, (1 - 2 * beta) * loading, n)

        points = _grid(limits, betas, (0.5, 1.0, 2.0))
        first = points[:, np.argmin(left(*points))]

        def cost(at):
            scale, beta, n = at
            return float(left(np.exp([scale]), np.array([beta]), np.exp([n]))[0])

        start = np.log(first[0]), first[1], np.log(first[2])
        best = minimize(cost, start, method="Nelder-Mead", options={"maxiter": 200})
        limit, n = np.exp(best.x[[0, 2]])
        print(
            f"{args.case}: a {kind.name} leaves {best.fun:.4f} of the force "
            f"(limit {limit:.3g}, beta {best.x[1]:.3g}, power {n:.3g})"
        )


if __name__ == "__main__":
    main()
