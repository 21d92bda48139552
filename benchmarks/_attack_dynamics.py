"""Compute accelerations, gaps and contact forces of a problem with only numpy."""

import itertools

import numpy as np

from ._attack_systems import Problem


class Dynamics:
    """The functions of one problem; `y` contains positions, then velocities."""

    def __init__(self, problem: Problem):
        self.problem = problem
        self.d, self.m = problem.mass.size, problem.offset.size
        self._light = 1 / problem.mass
        # velocity change per unit impulse at a gap, one column per gap
        self.across = problem.normals.T * self._light[:, None]
        self.coupling = problem.normals @ self.across

    def acceleration(self, t, y):
        """Accelerations of the coordinates in free flight."""
        p, d = self.problem, self.d
        q, v = y[:d], y[d:]
        away = (t - p.kick_time) / p.kick_width
        force = p.weight + p.drive * np.cos(p.frequency * t + p.phase)
        force = force - p.stiffness @ q - p.cubic * q**3 - p.damping @ v
        if abs(away) < 38:
            force = force + p.kick * np.exp(-away * away / 2)
        return force * self._light

    def jerk(self, t, y, rate):
        """Rate of change of the free acceleration when `y` changes at `rate`."""
        p, d = self.problem, self.d
        q = y[:d]
        away = (t - p.kick_time) / p.kick_width
        force = -p.drive * p.frequency * np.sin(p.frequency * t + p.phase)
        force = force - p.stiffness @ rate[:d] - 3 * p.cubic * q * q * rate[:d]
        force = force - p.damping @ rate[d:]
        if abs(away) < 38:
            force = force - p.kick * np.exp(-away * away / 2) * away / p.kick_width
        return force * self._light

    def walls(self, t):
        """Position, velocity, acceleration and jerk of each wall, one row per wall."""
        p = self.problem
        w = p.wall_frequency
        angle = np.multiply.outer(t, w) + p.wall_phase
        swing, lag = p.wall * np.cos(angle), p.wall * np.sin(angle)
        return p.offset + swing, -w * lag, -w * w * swing, w**3 * lag

    def gaps(self, times, states):
        """Gaps and normal velocities, `(k, m)` each, for states in columns."""
        place, speed, *_ = self.walls(times)
        n, d = self.problem.normals, self.d
        return (n @ states[:d]).T - place, (n @ states[d:]).T - speed

    def closing(self, t, y):
        """Gaps and normal velocities at one time, `(m,)` each."""
        gap, velocity = self.gaps(np.array([t]), y[:, None])
        return gap[0], velocity[0]

    def pull(self, t, y):
        """Normal accelerations in free flight, `(m,)`."""
        return self.problem.normals @ self.acceleration(t, y) - self.walls(t)[2]

    def pressure(self, t, y, held):
        """Contact forces at the gaps `held`; positive if compressive."""
        rows = list(held)
        return np.linalg.solve(
            self.coupling[np.ix_(rows, rows)], -self.pull(t, y)[rows]
        )

    def field(self, t, y, held):
        """Rate of `y` while the gaps `held` are kept closed."""
        made = self.acceleration(t, y)
        if held:
            pressure = self.pressure(t, y, held)
            made = made + self.across[:, list(held)] @ pressure
        return np.concatenate([y[self.d :], made])

    def jets(self, t, y, held):
        """Normal acceleration and jerk of each gap while the gaps `held` are closed.

        The contact forces also change; their rate follows from that of the pull.
        """
        rate = self.field(t, y, held)
        n = self.problem.normals
        _, _, bend, rise = self.walls(t)
        jerk = self.jerk(t, y, rate)
        if held:
            rows = list(held)
            wanted = -(n @ jerk - rise)[rows]
            pressure = np.linalg.solve(self.coupling[np.ix_(rows, rows)], wanted)
            jerk = jerk + self.across[:, rows] @ pressure
        return rate, jerk, n @ rate[self.d :] - bend, n @ jerk - rise

    def restitution(self, k, velocity):
        """Coefficient of restitution of gap `k` at a negative normal velocity."""
        p = self.problem
        return p.restitution[k] * np.exp(p.softening[k] * velocity)

    def struck(self, y, k, velocity):
        """The state after an impact at gap `k` with normal velocity `velocity`."""
        jump = -(1 + self.restitution(k, velocity)) * velocity
        after = y.copy()
        after[self.d :] += self.across[:, k] * (jump / self.coupling[k, k])
        return after

    def held_of(self, t, y, closed):
        """The gaps among `closed`, all with zero normal velocity, that stay in contact.

        The contact forces of these gaps are compressive, and all other closed gaps
        open; `None` if no set of gaps satisfies this to within rounding.
        """
        closed = tuple(sorted(closed))
        for size in range(len(closed), -1, -1):
            for held in itertools.combinations(closed, size):
                if held and np.min(self.pressure(t, y, held)) <= 1e-9:
                    continue
                pull = self.jets(t, y, held)[2]
                if all(pull[k] > 1e-9 for k in closed if k not in held):
                    return held
        return None
