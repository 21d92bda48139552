"""Draw random systems: for jaxcam, and as matrices for the exact motion."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ._switching_linear import Linear
from ._switching_systems import Machine, Relay, Shaken, Walled


class Problem(NamedTuple):
    """A random system and its initial state at time 0."""

    family: str
    system: Any
    linear: Linear
    state: np.ndarray
    span: float
    # energy of a state, if it can never rise
    energy: Callable[[np.ndarray], float] | None
    # whether the comparison ends where impacts accumulate
    ends: bool


class Shape(NamedTuple):
    """Numbers of masses, friction forces and soft stops; whether there is a wall."""

    masses: int
    rubs: int
    stops: int
    wall: bool = False


MACHINES = {
    "stops": Shape(1, 0, 2),
    "stops, two masses": Shape(2, 0, 2),
    "friction": Shape(1, 1, 0),
    "friction, two masses": Shape(2, 2, 0),
    "friction and stop": Shape(2, 2, 1),
    "friction and impacts": Shape(2, 2, 0, wall=True),
    "friction beside impacts": Shape(2, 1, 0, wall=True),
    "stop and impacts": Shape(1, 0, 1, wall=True),
}
FAMILIES = (*MACHINES, "relays", "shaken contact")


def draw(seed: int) -> Problem:
    """The problem of a seed; its family is taken cyclically from `FAMILIES`."""
    rng = np.random.default_rng([28, seed])
    family = FAMILIES[seed % len(FAMILIES)]
    if family == "relays":
        return _relays(rng)
    if family == "shaken contact":
        return _shaken(rng)
    return _machine(rng, family, MACHINES[family])


def _some(rng, chance: float, values):
    """The values with this probability, otherwise zeros."""
    return values if rng.random() < chance else np.zeros_like(values)


def _arrays(kind, values: dict):
    """A system of jaxcam from numbers."""
    return kind(**{name: jnp.asarray(v, jnp.float64) for name, v in values.items()})


def _machine(rng, family: str, shape: Shape) -> Problem:
    values = _springs(rng, shape.masses)
    values |= _friction(rng, shape) | _stops(rng, shape)
    d = shape.masses
    state = np.concatenate([rng.normal(size=d), rng.normal(size=d)])
    if shape.rubs and rng.random() < 0.25:
        # it sticks at the start, or slips from rest
        state[d:] = np.linalg.pinv(values["slips"]) @ values["belts"]
        # so that rounding leaves no slip
        values["belts"] = values["slips"] @ state[d:]
        state[:d] *= 0.3
    ends = shape.wall and bool(np.any(values["slips"][:, 0]))
    if shape.wall:
        values["wall"] = np.asarray(rng.uniform(-0.3, 1.0))
        values["restitution"] = np.asarray(rng.choice([0.0, rng.uniform(0.05, 0.8)]))
        state[0] = values["wall"] - abs(state[0]) - 0.05
    conserves = not (
        np.any(values["drive"]) or np.any(values["belts"]) or np.any(values["sway"])
    )
    energy = (lambda x: _energy(values, x)) if conserves else None
    system = _arrays(Walled if shape.wall else Machine, values)
    span = rng.uniform(10.0, 25.0)
    return Problem(family, system, _linear(values), state, span, energy, ends)


def _springs(rng, d: int) -> dict:
    root = np.eye(d) + 0.4 * rng.normal(size=(d, d))
    loss = 0.3 * rng.normal(size=(d, d))
    return dict(
        mass=rng.uniform(0.5, 2.0, size=d),
        stiffness=root @ root.T * rng.uniform(0.3, 3.0),
        damping=_some(rng, 0.6, loss @ loss.T + 0.02 * np.eye(d)),
        weight=_some(rng, 0.3, 0.5 * rng.normal(size=d)),
        drive=_some(rng, 0.7, rng.uniform(0.3, 2.0) * rng.normal(size=d)),
        omega=np.asarray(10 ** rng.uniform(-0.4, 0.5)),
        phase=np.asarray(rng.uniform(0, 2 * np.pi)),
    )


def _friction(rng, shape: Shape) -> dict:
    """Friction on ground and belts, or between the two masses."""
    d, f = shape.masses, shape.rubs
    slips = np.eye(d)[d - f :]
    if f == 2 and rng.random() < 0.3:
        slips = np.array([[1.0, 0.0], [-1.0, 1.0]])
    return dict(
        slips=slips,
        belts=_some(rng, 0.5, 0.6 * rng.normal(size=f)),
        friction=10 ** rng.uniform(-1.3, 0.1, size=f),
        sway=_some(rng, 0.3, rng.uniform(-0.8, 0.8, size=f)),
        static=np.where(rng.random(f) < 0.5, 1.0, rng.uniform(1.0, 2.0, size=f)),
    )


def _stops(rng, shape: Shape) -> dict:
    d, s = shape.masses, shape.stops
    normals = rng.normal(size=(s, d))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    if d == 1 and s == 2:
        normals[:] = [[1.0], [-1.0]]
    if shape.wall:
        normals[:] = -1.0
    # with a level below zero, a stop is preloaded: it always presses near the middle
    levels = rng.uniform(-0.2, 1.0, size=s)
    return dict(
        normals=normals,
        levels=levels,
        springs=10 ** rng.uniform(-0.5, 1.7, size=s),
        dampers=_some(rng, 0.4, rng.uniform(0.0, 1.0, size=s)),
        preload=_some(rng, 0.4, rng.uniform(-0.3, 0.6, size=s)),
    )


def _energy(values: dict, x) -> float:
    d = len(values["mass"])
    q, v = x[:d], x[d:]
    depth = np.maximum(values["normals"] @ q - values["levels"], 0.0)
    pressed = values["springs"] * depth**2 / 2 + values["preload"] * depth
    kept = q @ values["stiffness"] @ q / 2 - values["weight"] @ q
    return float(values["mass"] @ v**2 / 2 + kept + np.sum(pressed))


def _linear(values: dict) -> Linear:
    """The matrices of a machine."""
    d, f, s = len(values["mass"]), len(values["friction"]), len(values["levels"])
    n = 2 * d
    one, turn = np.eye(n + 3)[n], np.eye(n + 3)[n + 1]
    field = np.zeros((n, n + 3))
    field[:d, d:n] = np.eye(d)
    field[d:, :d], field[d:, d:n] = -values["stiffness"], -values["damping"]
    field[d:, n], field[d:, n + 1] = values["weight"], values["drive"]
    rows, kicks, loads = (np.zeros((f + s, k)) for k in (n + 3, n, n + 3))
    for k in range(f):
        rows[k, d:n], rows[k, n] = values["slips"][k], -values["belts"][k]
        kicks[k, d:] = -values["slips"][k]
        loads[k] = values["friction"][k] * (one + values["sway"][k] * turn)
    for k in range(s):
        rows[f + k, :d], rows[f + k, n] = values["normals"][k], -values["levels"][k]
        pressed = values["springs"][k] * rows[f + k] + values["preload"][k] * one
        pressed[d:n] += values["dampers"][k] * values["normals"][k]
        kicks[f + k, d:], loads[f + k] = -values["normals"][k], pressed / 2
        # half of the force acts on both sides, the other half has the sign of the side
        field += np.outer(kicks[f + k], loads[f + k])
    field[d:] /= values["mass"][:, None]
    kicks[:, d:] /= values["mass"]
    gaps, normals, restitution = np.zeros((0, n + 3)), np.zeros((0, n)), np.zeros(0)
    if "wall" in values:
        gaps = (values["wall"] * one - np.eye(n + 3)[0])[None]
        normals, restitution = -np.eye(n)[d][None], values["restitution"][None]
    return Linear(
        omega=float(values["omega"]),
        phase=float(values["phase"]),
        field=field,
        rows=rows,
        kicks=kicks,
        loads=loads,
        width=np.zeros(f + s),
        holding=np.append(values["static"], np.ones(s)),
        slidable=(True,) * f + (False,) * s,
        gaps=gaps,
        normals=normals,
        restitution=restitution,
    )


def _relays(rng) -> Problem:
    n, k = 3, 2
    turn = rng.normal(size=(n, n))
    width = np.full(k, rng.uniform(0.02, 0.4)) if rng.random() < 0.6 else np.zeros(k)
    values = dict(
        matrix=1.5 * (turn - turn.T) - rng.uniform(0.05, 0.5) * np.eye(n),
        force=0.5 * rng.normal(size=n),
        drive=_some(rng, 0.5, rng.normal(size=n)),
        omega=np.asarray(10 ** rng.uniform(-0.4, 0.5)),
        phase=np.asarray(rng.uniform(0, 2 * np.pi)),
        pushes=rng.normal(size=(k, n)),
        normals=rng.normal(size=(k, n)),
        levels=0.3 * rng.normal(size=k),
        width=width,
    )
    one = np.eye(n + 3)[n]
    field = np.zeros((n, n + 3))
    field[:, :n], field[:, n] = values["matrix"], values["force"]
    field[:, n + 1] = values["drive"]
    linear = Linear(
        omega=float(values["omega"]),
        phase=float(values["phase"]),
        field=field,
        rows=np.hstack([values["normals"], np.zeros((k, 3))])
        - np.outer(values["levels"], one),
        kicks=values["pushes"],
        loads=np.tile(one, (k, 1)),
        width=width,
        holding=np.ones(k),
        slidable=(True,) * k,
        gaps=np.zeros((0, n + 3)),
        normals=np.zeros((0, n)),
        restitution=np.zeros(0),
    )
    system, state = _arrays(Relay, values), rng.normal(size=n)
    span = rng.uniform(8.0, 20.0)
    return Problem("relays", system, linear, state, span, None, False)


def _shaken(rng) -> Problem:
    incline, direction = rng.uniform(-0.6, 0.6), rng.uniform(0, 2 * np.pi)
    strength = _some(rng, 0.85, np.asarray(rng.uniform(0.2, 2.0)))
    spring = _some(rng, 0.5, np.asarray(rng.uniform(0.2, 2.0)))
    oblique = _some(rng, 0.5, spring * rng.uniform(-0.5, 0.5)) if strength else 0.0
    values = dict(
        gravity=np.array([np.sin(incline), -np.cos(incline)]),
        shaking=strength * np.array([np.cos(direction), np.sin(direction)]),
        omega=np.asarray(10 ** rng.uniform(-0.3, 0.6)),
        phase=np.asarray(rng.uniform(0, 2 * np.pi)),
        spring=spring,
        oblique=np.asarray(oblique),
        damping=_some(rng, 0.5, np.asarray(rng.uniform(0.0, 0.3))),
        mu=np.asarray(10 ** rng.uniform(-1.0, 0.0)),
        static=np.asarray(rng.choice([1.0, rng.uniform(1.0, 2.0)])),
        restitution=np.asarray(rng.choice([0.0, rng.uniform(0.05, 0.8)])),
    )
    n = 4
    field = np.zeros((n, n + 3))
    field[:2, 2:4] = np.eye(2)
    field[2:, n], field[2:, n + 1] = values["gravity"], values["shaking"]
    field[2, 0], field[2, 2], field[3, 0] = -spring, -values["damping"], oblique
    unit = np.eye(n + 3)
    linear = Linear(
        omega=float(values["omega"]),
        phase=float(values["phase"]),
        field=field,
        rows=unit[2:3],
        kicks=-np.eye(n)[2:3],
        loads=np.zeros((1, n + 3)),
        width=np.zeros(1),
        holding=values["static"][None],
        slidable=(True,),
        gaps=unit[1:2],
        normals=np.eye(n)[3:4],
        restitution=values["restitution"][None],
        rubs=float(values["mu"]),
    )
    state = np.array([rng.normal(), rng.uniform(0.05, 1.0), rng.normal(), rng.normal()])
    if rng.random() < 0.4:
        # start on the plane, if it does not throw the block off at once
        on = np.array([state[0], 0.0, rng.choice([0.0, state[2]]), 0.0])
        state = on if field[3] @ linear.extended(on, 0.0) < -0.01 else state

    def energy(x):
        kept = spring * x[0] ** 2 / 2 - values["gravity"] @ x[:2]
        return float(x[2:] @ x[2:] / 2 + kept)

    system, span = _arrays(Shaken, values), rng.uniform(10.0, 25.0)
    conserved = None if strength else energy
    return Problem("shaken contact", system, linear, state, span, conserved, False)
