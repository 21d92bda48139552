# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: light
# ---

# # A0. Two masses, two stops
#
# This notebook defines a system that is not included in jaxcam: two masses in a chain
# of springs. The first mass is driven by a force, and each mass has a stop. Wagg (2004,
# 2005) studied such systems and found that one mass can stick to its stop while the
# other continues to move.
#
# We define the system, simulate it, and look at impacts, sticking and the steady state.

# +
from typing import ClassVar

import jax.numpy as jnp
import matplotlib.pyplot as plt

import jaxcam
from jaxcam.plotting import phase_portrait, style, time_history


# -

# ## The system
#
# The state consists of the two displacements and the two velocities. All quantities are
# dimensionless: the first mass and the stiffness of each spring are equal to one. The
# first mass is connected to the frame and to the second mass. The stops are at `stop_1`
# and `stop_2`; each has a gap and a row in the result of `impact`.


class TwoMasses(jaxcam.HybridSystem):
    """Two masses in a chain, each with a rigid stop."""

    state_names: ClassVar[tuple[str, ...]] = ("x1", "x2", "v1", "v2")
    state_units: ClassVar[tuple[str, ...]] = ("-", "-", "-", "-")
    constraint_names: ClassVar[tuple[str, ...]] = ("stop 1", "stop 2")

    mass_ratio: float = 1.0
    damping: float = 0.1
    force: float = 1.0
    frequency: float = 0.2
    stop_1: float = 0.5
    stop_2: float = 0.3
    restitution: float = 0.5

    def vector_field(self, t, state):
        x1, x2, v1, v2 = state
        link = (x2 - x1) + self.damping * (v2 - v1)
        frame = -x1 - self.damping * v1
        shaken = self.force * jnp.cos(self.frequency * t)
        return jnp.stack([v1, v2, frame + link + shaken, -link / self.mass_ratio])

    def gap(self, t, state):
        return jnp.stack([self.stop_1 - state[0], self.stop_2 - state[1]])

    def impact(self, t, state):
        x1, x2, v1, v2 = state
        r = self.restitution
        return jnp.stack(
            [jnp.stack([x1, x2, -r * v1, v2]), jnp.stack([x1, x2, v1, -r * v2])]
        )

    @property
    def period(self):
        return 2 * jnp.pi / self.frequency


# ## Simulate the system

# +
system = TwoMasses()
turns = 12
trajectory = jaxcam.simulate(system, jnp.zeros(4), 0.0, turns * float(system.period))
assert trajectory.successful, trajectory.result

for k in range(2):
    hits = int((trajectory.impacts.constraint == k).sum())
    held = trajectory.contacts.constraint == k
    rest = float((trajectory.contacts.end - trajectory.contacts.start)[held].sum())
    share = rest / float(trajectory.t1)
    print(f"stop {k + 1}: {hits} impacts listed, in contact {share:.1%} of the time")

turn = trajectory.stroboscopic()
print("change of the state over the last period:", abs(turn[-1] - turn[-2]).max())
# -

# Neither mass ever penetrates its stop, not even between the steps of the integration:

times = jnp.linspace(0.0, trajectory.t1, 20_001)
lowest = trajectory.gap(times).min(axis=0)
print("smallest gaps:", lowest)
assert (lowest > -1e-9).all()

# ## Figures

history = time_history(
    trajectory,
    components=(0, 1),
    between=(trajectory.t1 - system.period, trajectory.t1),
)

with style():
    portraits, panels = plt.subplots(1, 2, figsize=(9, 4))
for k, ax in enumerate(panels):
    last = (trajectory.t1 - 2 * system.period, trajectory.t1)
    phase_portrait(trajectory, ax, components=(k, 2 + k), between=last)

# The states sampled once per period coincide, so the motion has become periodic. In
# each period both masses chatter against their stops, stick, and are released.
