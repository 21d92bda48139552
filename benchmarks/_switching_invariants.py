"""Conditions that a run must fulfil at each of its integration points."""

import numpy as np

from ._switching_draw import Problem
from ._switching_linear import Law, law, Linear, Mode


# permitted excess of the friction force, and rise of the energy, relative to their size
_OUTSIDE, _RISE = 1e-9, 1e-9


def broken(problem: Problem, run, end: float) -> str:
    """A condition that a run violates before the time `end`, or an empty string."""
    number = int(run.steps.count)
    times = np.asarray(run.steps.time)[:number]
    states = np.asarray(run.steps.state)[:number]
    sides = np.asarray(run.steps.sides)[:number]
    contact = np.asarray(run.steps.contact)[:number]
    if not np.all(np.isfinite(states)):
        return "a state is not finite"
    known = times < end
    times, states, sides = times[known], states[known], sides[known]
    said = _cone(problem, run, times, states, sides, contact[known])
    if not said and problem.energy is not None:
        said = _rise(problem, times, states)
    return said


def _cone(problem: Problem, run, times, states, sides, contact) -> str:
    """A point at which the force that holds a surface exceeds its limit."""
    linear, laws = problem.linear, {}
    jumps = set(np.asarray(run.impacts.time).tolist())
    lasts = np.append(np.diff(times) > 0, False)
    for i in np.flatnonzero(np.any(sides == 0, axis=1) & lasts):
        held = tuple(bool(b) for b in sides[i] == 0)
        mode = Mode(
            tuple(int(s) if s else 1 for s in sides[i]),
            held,
            tuple(bool(b) for b in contact[i]),
        )
        if linear.rubs and not any(mode.contact):
            return f"t = {times[i]:.9g}: sticks without contact"
        if mode not in laws:
            laws[mode] = law(linear, mode)
        for j in (i, i + 1):
            said = _held(linear, laws[mode], times[j], states[j])
            if said and times[j] not in jumps:
                return said
    return ""


def _held(linear: Linear, rules: Law, t: float, x) -> str:
    """A surface that slips or is held beyond its limit at one point, in words."""
    z, size = linear.extended(x, t), 1 + np.max(np.abs(x))
    for k in rules.needed:
        needed, limit = abs(rules.needed[k] @ z), rules.limit[k] @ z
        if needed > limit + _OUTSIDE * size:
            what = f"is held by {needed:.9g}, more than {limit:.9g}"
        elif abs(linear.rows[k] @ z) > _OUTSIDE * size:
            what = f"slips by {abs(linear.rows[k] @ z):.1e}"
        else:
            continue
        return f"t = {t:.9g}: surface {k} {what}"
    return ""


def _rise(problem: Problem, times, states) -> str:
    """A rise of the energy from one point to the next."""
    assert problem.energy is not None
    energy = np.array([problem.energy(x) for x in states])
    rise = np.diff(energy)
    size = 1 + np.max(np.abs(energy), initial=0.0)
    if np.max(rise, initial=0.0) > _RISE * size:
        i = int(np.argmax(rise))
        return f"t = {times[i + 1]:.9g}: the energy rises by {rise[i]:.1e}"
    return ""
