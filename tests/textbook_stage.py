"""A stage on a spring that a voltage pushes against a surface, simulated on its own."""

import jax.numpy as jnp
import numpy as np

from jaxcam import HybridSystem


GAIN, STIFFNESS, DAMPING, INTERVAL = 120.0, 600.0, 12.0, 4e-3


class Stage(HybridSystem):
    """Mass, spring and damper, pushed by a voltage; nothing is touched."""

    gain: float = 100.0
    stiffness: float = 650.0
    damping: float = 13.0
    voltage: float = 0.0

    def vector_field(self, t, state):
        pull = self.stiffness * state[0] + self.damping * state[1]
        return jnp.stack([state[1], self.gain * self.voltage - pull])

    def gap(self, t, state):
        return state[0] + 100.0

    def impact(self, t, state):
        return state


def staged(seed: int, edge: float, stiffness: float, loss: float, count: int = 1500):
    """Times, voltages and positions of a stage above whose `edge` there is a surface.

    Small classical Runge-Kutta steps; the loss of the surface is against the motion and
    grows with the depth.
    """
    rng = np.random.default_rng(seed)
    levels = np.repeat(rng.uniform(0.02, 0.13, count // 50), 50)
    steps = 20
    h = INTERVAL / steps

    def field(x, v, level):
        depth = max(x - edge, 0.0)
        turned = np.tanh(v / 1e-4)
        push = GAIN * level - STIFFNESS * x - DAMPING * v
        return v, push - depth * (stiffness + loss * turned)

    x, v, found = 0.01, 0.0, []
    for level in levels:
        found.append(x)
        for _ in range(steps):
            a, b = field(x, v, level)
            c, d = field(x + h / 2 * a, v + h / 2 * b, level)
            e, f = field(x + h / 2 * c, v + h / 2 * d, level)
            g, k = field(x + h * e, v + h * f, level)
            x += h / 6 * (a + 2 * c + 2 * e + g)
            v += h / 6 * (b + 2 * d + 2 * f + k)
    time = INTERVAL * np.arange(count)
    return time, levels, np.array(found)
