"""Generate random piecewise-smooth systems, and formulate them for jaxcam.

A problem is generated in its own units, in which lengths and times are near one. For
jaxcam it is converted to SI units with a length unit of 1e-6 to 1e6 m, a time unit of
1e-3 to 1e3 s, and a start time of up to 1e4 s.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

import jaxcam


# numbers of coordinates and gaps of the random systems; each pair is compiled once
SHAPES = ((1, 1), (1, 2), (2, 1), (2, 2), (3, 1), (3, 3))
# kinds of initial state
STARTS = ("free", "surface", "rest")


@dataclasses.dataclass(frozen=True)
class Problem:
    """A system with d coordinates and m gaps, and its initial state, in its own units.

    M q'' = -K q - k3 q^3 - (C + G) q' + w + A cos(omega t + phi)
            + P exp(-(t - s)^2 / (2 width^2)),
    g = N q - b - B cos(Omega t + psi) >= 0, and each impact multiplies the normal
    velocity v < 0 by -r exp(softening v), along the direction M^-1 n.
    """

    mass: np.ndarray
    stiffness: np.ndarray
    cubic: np.ndarray
    # dissipation and gyroscopic coupling together
    damping: np.ndarray
    weight: np.ndarray
    drive: np.ndarray
    frequency: float
    phase: float
    kick: np.ndarray
    kick_time: float
    kick_width: float
    normals: np.ndarray
    offset: np.ndarray
    wall: np.ndarray
    wall_frequency: np.ndarray
    wall_phase: np.ndarray
    restitution: np.ndarray
    softening: np.ndarray
    # positions, then velocities
    state: np.ndarray
    # gaps that are closed at the start with zero normal velocity
    resting: tuple[int, ...]
    span: float
    # units of length and time (m, s), and the start time (s)
    length: float
    time: float
    begin: float

    @property
    def kicked(self) -> bool:
        """Whether there is a short force pulse."""
        return bool(np.any(self.kick))

    @property
    def conservative(self) -> bool:
        """Whether all forces are time-independent or dissipative."""
        return not (self.kicked or np.any(self.drive) or np.any(self.wall))

    def in_plain_units(self) -> "Problem":
        """The same problem in unit scales, starting at time zero."""
        return dataclasses.replace(self, length=1.0, time=1.0, begin=0.0)


def draw(seed: int) -> Problem:
    """The problem for a seed; its shape is taken cyclically from `SHAPES`."""
    rng = np.random.default_rng([24, seed])
    d, m = SHAPES[seed % len(SHAPES)]

    def some(chance, values):
        return values if rng.random() < chance else np.zeros_like(values)

    # a positive definite stiffness with frequencies near one
    root = np.eye(d) + 0.3 * rng.normal(size=(d, d))
    stiffness = some(0.8, root @ root.T * rng.uniform(0.3, 3.0))
    bound = bool(np.any(stiffness))
    loss = 0.3 * rng.normal(size=(d, d))
    skew = rng.normal(size=(d, d))
    damping = some(0.7, loss @ loss.T + 0.05 * np.eye(d))
    damping = damping + some(0.4, rng.uniform(0.1, 1.0) * (skew - skew.T))
    normals = rng.normal(size=(m, d))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    if d == 1 and m == 2:
        normals[1] = -normals[0]
    offset = -rng.uniform(0.05, 1.0, size=m)
    # a force towards the first wall: without a spring nothing else brings the system
    # back
    press = 0.9 if bound else 1.0
    weight = some(press, -normals[0] * rng.uniform(0.3, 2.0))
    weight = weight + some(0.3, 0.3 * rng.normal(size=d))
    moving = rng.random(m) < 0.35
    wall = np.where(moving, rng.uniform(0.02, 0.3, size=m), 0.0)
    if d == 1 and m == 2:
        # two walls that never meet
        offset -= max(np.sum(wall) + np.sum(offset) + 0.1, 0.0) / 2
    width = 10 ** rng.uniform(-2.0, -0.5)
    problem = Problem(
        mass=rng.uniform(0.5, 2.0, size=d),
        stiffness=stiffness,
        cubic=some(0.4 if bound else 0.0, rng.uniform(0.0, 0.5, size=d)),
        damping=damping,
        weight=weight,
        drive=some(0.5, rng.uniform(0.2, 2.0) * rng.normal(size=d)),
        frequency=10 ** rng.uniform(-0.3, 0.6),
        phase=rng.uniform(0, 2 * np.pi),
        kick=some(0.25, rng.normal(size=d) * rng.uniform(0.3, 1.0) / width),
        kick_time=rng.uniform(1.0, 10.0),
        kick_width=width,
        normals=normals,
        offset=offset,
        wall=wall,
        wall_frequency=10 ** rng.uniform(-0.3, 0.7, size=m),
        wall_phase=rng.uniform(0, 2 * np.pi, size=m),
        restitution=rng.uniform(0.05, 0.95, size=m),
        softening=np.where(rng.random(m) < 0.3, rng.uniform(0.02, 0.3, size=m), 0.0),
        state=np.zeros(2 * d),
        resting=(),
        span=rng.uniform(8.0, 25.0),
        length=10 ** rng.uniform(-6, 6),
        time=10 ** rng.uniform(-3, 3),
        begin=rng.choice([0.0, rng.uniform(0, 10), 10 ** rng.uniform(1, 4)]),
    )
    return _started(problem, rng)


def _started(problem: Problem, rng) -> Problem:
    """The problem with an admissible initial state."""
    d, m = problem.mass.size, problem.offset.size
    kind = rng.choice(STARTS, p=[0.6, 0.15, 0.25])
    scale = 1.0
    for _ in range(60):
        state = np.concatenate([rng.normal(size=d), rng.normal(size=d)]) * scale
        closed = () if kind == "free" else (0,)
        state = settled(problem, state, closed, 0.0)
        if kind == "surface":
            # the gap is zero, and opens or closes
            state[d:] += rng.normal() * problem.normals[0] / problem.mass
        others = [k for k in range(m) if k not in closed]
        gaps = gaps_of(problem, 0.0, state)
        if np.all(gaps[others] > 0.02):
            resting = closed if kind == "rest" else ()
            return dataclasses.replace(problem, state=state, resting=resting)
        scale *= 0.93
    # start at the origin, off all surfaces, and move the walls if it lies beyond one
    lift = np.max(-gaps_of(problem, 0.0, np.zeros(2 * d)))
    offset = problem.offset - max(lift + 0.05, 0.0)
    return dataclasses.replace(problem, offset=offset, state=np.zeros(2 * d))


def gaps_of(problem: Problem, t: float, state: np.ndarray) -> np.ndarray:
    """Gaps at a time, shape `(m,)`."""
    q = state[: problem.mass.size]
    swing = np.cos(problem.wall_frequency * t + problem.wall_phase)
    return problem.normals @ q - problem.offset - problem.wall * swing


def settled(problem: Problem, state, closed, t: float) -> np.ndarray:
    """The state moved to zero gap and zero normal velocity at the gaps `closed`."""
    if not closed:
        return state
    d, rows = problem.mass.size, list(closed)
    normals = problem.normals[rows]
    across = normals.T / problem.mass[:, None]
    angle = problem.wall_frequency * t + problem.wall_phase
    speed = -problem.wall * problem.wall_frequency * np.sin(angle)
    gap = gaps_of(problem, t, state)[rows]
    velocity = normals @ state[d:] - speed[rows]
    both = np.linalg.solve(normals @ across, np.stack([gap, velocity], axis=1))
    return state - np.concatenate([across @ both[:, 0], across @ both[:, 1]])


class Attacked(jaxcam.HybridSystem):
    """`Problem` as a user would define it, in SI units."""

    mass: jax.Array
    stiffness: jax.Array
    cubic: jax.Array
    damping: jax.Array
    weight: jax.Array
    drive: jax.Array
    frequency: jax.Array
    phase: jax.Array
    kick: jax.Array
    kick_time: jax.Array
    kick_width: jax.Array
    normals: jax.Array
    offset: jax.Array
    wall: jax.Array
    wall_frequency: jax.Array
    wall_phase: jax.Array
    restitution: jax.Array
    softening: jax.Array

    def vector_field(self, t, state):
        d = self.mass.shape[0]
        q, v = state[:d], state[d:]
        away = (t - self.kick_time) / self.kick_width
        force = (
            self.weight
            + self.drive * jnp.cos(self.frequency * t + self.phase)
            + self.kick * jnp.exp(-away * away / 2)
            - self.stiffness @ q
            - self.cubic * q * q * q
            - self.damping @ v
        )
        return jnp.concatenate([v, force / self.mass])

    def gap(self, t, state):
        q = state[: self.mass.shape[0]]
        swing = jnp.cos(self.wall_frequency * t + self.wall_phase)
        gaps = self.normals @ q - self.offset - self.wall * swing
        return gaps if self.offset.shape[0] > 1 else gaps[0]

    def impact(self, t, state):
        d, m = self.mass.shape[0], self.offset.shape[0]
        angle = self.wall_frequency * t + self.wall_phase
        surface = -self.wall * self.wall_frequency * jnp.sin(angle)
        rows = []
        for k in range(m):
            normal = self.normals[k]
            velocity = normal @ state[d:] - surface[k]
            share = 1 + self.restitution[k] * jnp.exp(self.softening[k] * velocity)
            across = normal / self.mass
            jump = -share * velocity / (normal @ across) * across
            rows.append(jnp.concatenate([state[:d], state[d:] + jump]))
        return jnp.stack(rows) if m > 1 else rows[0]

    @property
    def breakpoints(self):
        # a short force pulse is declared by the times at which it begins, peaks and
        # ends
        sides = jnp.asarray([-7.0, 0.0, 7.0])
        return self.kick_time + sides * self.kick_width


def stated(problem: Problem) -> tuple[Attacked, np.ndarray, float, float]:
    """The system, its initial state, and the start and end times of the run, in SI
    units.
    """
    p, length, time = problem, problem.length, problem.time
    force = length / time**2

    def shifted(phase, frequency):
        # longdouble: a late start time amplifies the rounding of the phase
        turn = np.longdouble(frequency) / time * np.longdouble(p.begin)
        return np.asarray(
            np.remainder(phase - turn, 2 * np.longdouble(np.pi)), np.float64
        )

    values = dict(
        mass=p.mass,
        stiffness=p.stiffness / time**2,
        cubic=p.cubic / (length * time) ** 2,
        damping=p.damping / time,
        weight=p.weight * force,
        drive=p.drive * force,
        frequency=p.frequency / time,
        phase=shifted(p.phase, p.frequency),
        kick=p.kick * force,
        kick_time=p.begin + p.kick_time * time,
        kick_width=p.kick_width * time,
        normals=p.normals,
        offset=p.offset * length,
        wall=p.wall * length,
        wall_frequency=p.wall_frequency / time,
        wall_phase=shifted(p.wall_phase, p.wall_frequency),
        restitution=p.restitution,
        softening=p.softening * time / length,
    )
    arrays = {name: jnp.asarray(value, jnp.float64) for name, value in values.items()}
    d = p.mass.size
    state = p.state * length
    state[d:] /= time
    return Attacked(**arrays), state, p.begin, p.begin + p.span * time
