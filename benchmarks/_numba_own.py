"""A scalar loop for the pendulum of `own_system.py`, compiled with numba.

It takes unrolled steps of `diffrax.Dopri8`, with the functions as a user would write
them. It locates impacts by Newton's method on the step length, completes chatter to
second order, and computes the release from the fixed wall in closed form.
"""

import math

import numpy as np
from diffrax import Dopri8
from numba import njit


_TABLEAU = Dopri8.tableau
_CHATTER = 1e-3


@njit(inline="always")
def _force(t, q, w, damping, amplitude, frequency):
    return -math.sin(q) - damping * w + amplitude * math.cos(frequency * t)


def _step_text() -> str:
    """Source of one step, with every stage written out."""
    lower, c = _TABLEAU.a_lower, _TABLEAU.c
    lines = [
        "def step(t, q, w, h, d, a, f):",
        " v0 = w",
        " k0 = force(t, q, w, d, a, f)",
    ]
    for i, row in enumerate(lower, start=1):
        for name, base in (("v", "w"), ("x", "q")):
            slopes = "k" if name == "v" else "v"
            terms = [f"{b!r} * {slopes}{j}" for j, b in enumerate(map(float, row)) if b]
            lines.append(f" {name}{i} = {base} + h * ({' + '.join(terms)})")
        time = f"t + {float(c[i - 1])!r} * h"
        lines.append(f" k{i} = force({time}, x{i}, v{i}, d, a, f)")
    for out, slopes, base in (("q1", "v", "q + "), ("w1", "k", "w + ")):
        weights = map(float, _TABLEAU.b_sol)
        terms = [f"{b!r} * {slopes}{j}" for j, b in enumerate(weights) if b]
        lines.append(f" {out} = {base}h * ({' + '.join(terms)})")
    for out, slopes in (("dq", "v"), ("dw", "k")):
        weights = map(float, _TABLEAU.b_error)
        terms = [f"{b!r} * {slopes}{j}" for j, b in enumerate(weights) if b]
        lines.append(f" {out} = h * ({' + '.join(terms)})")
    return "\n".join([*lines, " return q1, w1, dq, dw"])


_made: dict = {"force": _force}
exec(compile(_step_text(), "<Dopri8>", "exec"), _made)
_step = njit(error_model="numpy")(_made["step"])


@njit(error_model="numpy")
def _lane(q, w, wall, r, d, a, f, tolerance, samples):
    turns = samples.shape[0]
    period = 2 * math.pi / f
    # a longer step could jump over a contact
    longest = period / 8
    t, h = 0.0, longest / 4
    done = impacts = 0
    while done < turns:
        strobe = (done + 1) * period
        step = min(h, strobe - t)
        q1, w1, dq, dw = _step(t, q, w, step, d, a, f)
        scale_q = tolerance * (1 + max(abs(q), abs(q1)))
        scale_w = tolerance * (1 + max(abs(w), abs(w1)))
        error = max(abs(dq) / scale_q, abs(dw) / scale_w, 1e-14)
        factor = min(6.0, max(0.2, 0.9 * error**-0.125))
        if error > 1:
            h = step * factor
            continue
        if q1 >= wall:
            sampled = step == strobe - t
            t, q, w = t + step, q1, w1
            h = min(max(h, step * factor) if sampled else step * factor, longest)
            if sampled:
                samples[done, 0], samples[done, 1] = q, w
                done += 1
            continue
        for _ in range(20):
            step = min(max(step - (q1 - wall) / w1, 0.0), 2 * step)
            q1, w1, dq, dw = _step(t, q, w, step, d, a, f)
            if abs(q1 - wall) < 1e-13:
                break
        impacts += 1
        t, q, w = t + step, wall, -r * w1
        k = _force(t, q, w, d, a, f)
        jerk = -math.cos(q) * w - d * k - a * f * math.sin(f * t)
        h = min(h, abs(w / k))
        if k < 0 and abs(jerk) * w < _CHATTER * (1 - r) * k * k:
            stuck = (
                t - 2 * w / (k * (1 - r)) - 4 / 3 * jerk * w**2 / k**3 / (1 - r) ** 2
            )
            # it is released where the force on a pendulum at rest on the wall turns
            # outward
            phase = 2 * math.pi - math.acos(math.sin(wall) / a)
            let_go = phase / f + period * math.ceil((t - phase / f) / period)
            if stuck < let_go:
                while done < turns and (done + 1) * period <= let_go:
                    samples[done, 0], samples[done, 1] = wall, 0.0
                    done += 1
                t, q, w, h = let_go, wall, 0.0, 1e-2 * period
    return impacts


@njit(error_model="numpy")
def _lanes(start, wall, r, d, a, f, tolerance, samples, impacts):
    for i in range(start.shape[0]):
        q, w = start[i]
        impacts[i] = _lane(q, w, wall, r, d, a, f, tolerance, samples[i])


def simulate(start, turns: int, numbers, tolerance: float = 1e-9):
    """Return samples `(lanes, turns, 2)` once per period, and impacts `(lanes,)`.

    **Arguments:** `numbers` are wall, restitution, damping, amplitude, frequency.
    """
    samples = np.empty((len(start), turns, 2))
    impacts = np.zeros(len(start), np.int64)
    _lanes(start, *numbers, tolerance, samples, impacts)
    return samples, impacts
