"""Systems with switching surfaces, and what they do according to other programs."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from jaxcam.hybrid import SwitchedSystem
from jaxcam.models import BilinearOscillator


class Affine(SwitchedSystem):
    """x' = (A + sum_i s_i A_i) x + b + sum_i s_i b_i, where s_i is 1 on the positive
    side of the surface c_i x = d_i, else 0.
    """

    matrix: jax.Array
    jumps: jax.Array
    force: jax.Array
    pushes: jax.Array
    normals: jax.Array
    levels: jax.Array
    width: jax.Array

    def switching(self, t, state):
        del t
        return self.normals @ state - self.levels

    def branch(self, t, state, sides):
        del t
        on = jnp.where(sides > 0, 1.0, 0.0)
        matrix = self.matrix + jnp.sum(on[:, None, None] * self.jumps, axis=0)
        return matrix @ state + self.force + jnp.sum(on[:, None] * self.pushes, axis=0)

    @property
    def hysteresis(self):
        return self.width


def random_affine(rng, *, jump: float, width: float = 0.0) -> Affine:
    """Three states, two surfaces; the field is continuous but for a `jump`."""
    n, k = 3, 2
    turn = rng.normal(size=(n, n))
    matrix = 2 * (turn - turn.T) - 0.1 * np.eye(n)
    normals = rng.normal(size=(k, n))
    levels, bends = rng.normal(size=k) * 0.3, rng.normal(size=(k, n))
    jumps = bends[:, :, None] * normals[:, None, :]
    pushes = -bends * levels[:, None] + jump * rng.normal(size=(k, n))
    force = rng.normal(size=n)
    whole = matrix, jumps, force, pushes, normals, levels, np.full(k, width)
    return Affine(*map(jnp.asarray, whole))


def integrated(system: Affine, state, t1):
    """Events of an affine system by scipy, one mode at a time.

    Their times, surfaces and kinds (0 crosses, 1 begins sliding, 2 leaves), and the
    final state. While it slides on surfaces, their shares of the positive branch make
    the rates of their switching functions zero.
    """
    a, jumps, b, pushes, c, d, width = (np.asarray(x) for x in jax.tree.leaves(system))
    t, x, events = 0.0, np.asarray(state, float), []
    on, slides = np.where(c @ x - d > 0, 1.0, 0.0), np.zeros(len(d), dtype=bool)

    def field(on, x):
        return (a + np.tensordot(on, jumps, 1)) @ x + b + on @ pushes

    def shares(on, slides, x):
        on = on.copy()
        (held,) = np.nonzero(slides)
        if len(held):
            free = np.where(slides, 0.0, on)
            gains = jumps @ x + pushes
            part = np.linalg.solve(c[held] @ gains[held].T, -c[held] @ field(free, x))
            on[held] = part
        return on

    def distance(i, on, slides, x):
        """Falls through zero at a crossing, or at the end of sliding."""
        if slides[i]:
            share = shares(on, slides, x)[i]
            return share * (1 - share)
        return (2 * on[i] - 1) * (c[i] @ x - d[i]) + width[i]

    while t < t1:
        watched = []
        for i in range(len(d)):

            def event(s, y, i=i, on=on, slides=slides):
                return distance(i, on, slides, y)

            # a start on the surface is behind it
            event.terminal, event.direction = True, -1
            watched.append(event)
        run = solve_ivp(
            lambda s, y, on=on, slides=slides: field(shares(on, slides, y), y),
            (t, t1),
            x,
            "DOP853",
            events=watched,
            rtol=1e-13,
            atol=1e-14,
            max_step=0.05,
        )
        t, x = run.t[-1], run.y[:, -1]
        if run.status != 1:
            break
        (i,) = [i for i, found in enumerate(run.t_events) if len(found)]
        t, x = run.t_events[i][0], run.y_events[i][0]
        on, slides = on.copy(), slides.copy()
        waiting = [i]
        while waiting:
            i = waiting[0]
            if slides[i]:
                on[i] = np.round(np.clip(shares(on, slides, x)[i], 0.0, 1.0))
                slides[i] = False
                events.append((t, i, 2))
            else:
                on[i] = 1 - on[i]
                rate = (2 * on[i] - 1) * (c[i] @ field(shares(on, slides, x), x))
                slides[i] = width[i] == 0 and rate < 0
                events.append((t, i, 1 if slides[i] else 0))
            waiting = [
                j for j in np.flatnonzero(slides) if distance(j, on, slides, x) < -1e-9
            ]
    times, which, kinds = np.array(events).reshape(-1, 3).T
    return times, which, kinds, x


def bilinear_motion(system: BilinearOscillator, state, t1):
    """Crossings and final state of a bilinear oscillator, by matrix exponentials."""
    zeta, k, stop = (
        float(getattr(system, n)) for n in ("damping", "stiffness", "stop")
    )
    force, omega = float(system.amplitude), float(system.omega)
    matrices = {}
    for side, stiffness, shift in ((1, k, (k - 1) * stop), (-1, 1.0, 0.0)):
        # state, one, cosine and sine of the forcing
        m = np.zeros((5, 5))
        m[0, 1] = 1.0
        m[1] = [-stiffness, -2 * zeta, shift, force, 0.0]
        m[3, 4], m[4, 3] = -omega, omega
        matrices[side] = m
    return _of_matrices(matrices, lambda x: x[0] - stop, [*state, 1.0, 1.0, 0.0], t1)


def _of_matrices(matrices, switching, z, t1):
    t, z, times = 0.0, np.array(z), []
    side = 1 if switching(z) > 0 or (switching(z) == 0 and z[1] > 0) else -1
    step = 0.02
    small = {s: expm(m * step) for s, m in matrices.items()}
    while True:
        start, h = z, 0.0
        while t + h < t1:
            after = small[side] @ z
            if side * switching(after) < 0:
                break
            z, h = after, h + step
        else:
            return np.array(times), (expm(matrices[side] * (t1 - t)) @ start)[:2]

        def value(s, side=side, start=start):
            return switching(expm(matrices[side] * s) @ start)

        root = brentq(value, max(h, 1e-9), h + step, xtol=1e-15, rtol=1e-15)
        if t + root > t1:
            return np.array(times), (expm(matrices[side] * (t1 - t)) @ start)[:2]
        z, t, side = expm(matrices[side] * root) @ start, t + root, -side
        times.append(t)
