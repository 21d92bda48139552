"""Conditions that a run must fulfil at each of its integration points."""

import numpy as np

from ._switching_draw import Problem
from ._switching_linear import law, Mode


# permitted excess of the friction force, and rise of the energy, relative to their size
_OUTSIDE, _RISE = 1e-9, 1e-9


def broken(problem: Problem, run, end: float) -> str:
    """What a run violates up to the time `end`, or an empty string."""
    number = int(run.steps.count)
    times = np.asarray(run.steps.time)[:number]
    states = np.asarray(run.steps.state)[:number]
    sides = np.asarray(run.steps.sides)[:number]
    contact = np.asarray(run.steps.contact)[:number]
    if not np.all(np.isfinite(states)):
        return "a state is not finite"
    known = times < end
    said = _cone(problem, times[known], states[known], sides[known], contact[known])
    if not said and problem.energy is not None:
        said = _rise(problem, times[known], states[known])
    return said


def _cone(problem: Problem, times, states, sides, contact) -> str:
    """A point at which the force that holds a surface exceeds its limit."""
    linear, laws = problem.linear, {}
    for i in np.flatnonzero(np.any(sides == 0, axis=1)):
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
        rules, z = laws[mode], linear.extended(states[i], times[i])
        size = 1 + np.max(np.abs(states[i]))
        for k in rules.needed:
            needed, limit = abs(rules.needed[k] @ z), rules.limit[k] @ z
            if needed > limit + _OUTSIDE * size:
                return (
                    f"t = {times[i]:.9g}: surface {k} is held by {needed:.9g}, more "
                    f"than {limit:.9g}"
                )
            slip = abs(linear.rows[k] @ z)
            if slip > _OUTSIDE * size:
                return f"t = {times[i]:.9g}: surface {k} slips by {slip:.1e}"
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
