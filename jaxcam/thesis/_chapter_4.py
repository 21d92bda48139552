"""Figures 4.5 and 4.13 to 4.16: motion program, free fall, contact, restitution."""

from typing import TYPE_CHECKING

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import brentq

from ..hybrid import simulate, Trajectory
from ..models import (
    CamFollower,
    contact_load,
    float_speed,
    MotionProgram,
    rad_s_to_rpm,
    rpm_to_rad_s,
    Segment,
)
from ._chapter_1 import released_turn, sticking_time
from ._chatter import at_speed
from ._frame import frame
from ._printed import PRODUCTS, SPEEDS


if TYPE_CHECKING:
    import pandas as pd


#: Figure 4.5 (a): function, and start, end and delta angle (degrees)
PROGRAM = (
    ("constant velocity", 0, 60, 60, 1.0),
    ("dwell", 60, 90, 30, 0.0),
    ("constant acceleration", 90, 150, 60, -1.0),
    ("dwell", 150, 180, 30, 0.0),
    ("cubic", 180, 240, 60, 1.0),
    ("dwell", 240, 270, 30, 0.0),
    ("simple harmonic", 270, 330, 60, -1.0),
    ("dwell", 330, 360, 30, 0.0),
)
#: speeds of Figures 4.14 and 4.16, and where contact is first lost (section 5.2)
CONTACT_SPEED, DETACHMENT = 110.0, 125.0
BOUNCES = (135.0, 143.0, 148.0, 150.0)
_NAN = float("nan")
#: where the free follower is let go (rad); not printed
_LET_GO = 0.75
#: where the spring is looked for at rest (rad)
_HANGING = (-1.55, 0.0)


def program_of_figure_4_5() -> MotionProgram:
    """The program, with rises of one."""
    return MotionProgram(
        [Segment(law, np.deg2rad(width), rise) for law, _, _, width, rise in PROGRAM]
    )


def figure_4_5(system: CamFollower) -> "pd.DataFrame":
    """Figure 4.5: angles of the segments, and which derivative jumps where.

    "Jumps first" is the order of the first derivative that is not continuous at the
    segment's start. The thesis shows it in its plots, in no table.
    """
    del system
    program = program_of_figure_4_5()
    ends = np.rad2deg(np.cumsum(np.asarray(program.widths)))
    starts = np.append(0.0, ends[:-1])
    angles, jumps = program.joints()
    degrees = np.rad2deg(np.asarray(angles))
    rows = []
    for k, (law, start, end, width, _) in enumerate(PROGRAM):
        name = f"segment {k + 1}, {law}"
        rows.append((f"{name}: start", start, starts[k], "degrees"))
        rows.append((f"{name}: end", end, ends[k], "degrees"))
        rows.append((f"{name}: delta", width, ends[k] - starts[k], "degrees"))
        here = int(np.argmin(np.abs(degrees - start)))
        sizes = np.abs(np.asarray(jumps[here]))
        order = int(np.argmax(sizes > 1e-9)) if np.any(sizes > 1e-9) else _NAN
        rows.append((f"{name}: jumps first in derivative", _NAN, order, ""))
    return frame(rows)


@eqx.filter_jit
def _spring(system, angle):
    """Torque of the spring at an angle, and its stiffness there."""
    torque = jax.grad(system.potential_energy)
    return torque(angle), jax.grad(torque)(angle)


def equilibrium(system: CamFollower) -> float:
    """The angle (rad) below the cam at which the spring holds the free follower."""
    low, high = _HANGING

    def torque(angle):
        return float(_spring(system, jnp.asarray(angle))[0])

    return float(brentq(torque, low, high))  # pyright: ignore


@eqx.filter_jit
def fall_angles(system: CamFollower, times) -> jax.Array:
    """The angle (rad) of the free follower, let go at 0.75 rad, at `times` (s)."""
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: system.vector_field(t, y)),
        diffrax.Dopri8(),
        times[0],
        times[-1],
        None,
        jnp.array([_LET_GO, 0.0]),
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.PIDController(rtol=1e-10, atol=1e-10),
    )
    assert solution.ys is not None
    return solution.ys[:, 0]


def figure_4_13(system: CamFollower) -> "pd.DataFrame":
    """Figure 4.13: free motion of the follower, with the M = J/K that it was fitted to.

    The recording behind the figure and the angle it starts from are not printed.
    """
    rest = equilibrium(system)
    _, stiffness = _spring(system, jnp.asarray(rest))
    frequency = np.sqrt(float(stiffness / system.inertia)) / (2 * np.pi)
    ratio = system.inertia / system.stiffness
    return frame(
        [
            ("M = J/K", 0.043 / 105, ratio, "m s^2"),
            ("angle of equilibrium", _NAN, rest, "rad"),
            ("frequency of small oscillations about it", _NAN, frequency, "Hz"),
        ]
    )


def constrained_run(system: CamFollower, rpm: float = CONTACT_SPEED) -> Trajectory:
    """Two turns at a speed, from the orbit that is in contact where it can be."""
    rig = at_speed(system, rpm_to_rad_s(rpm))
    return simulate(rig, None, 0.0, 2 * float(rig.period))


def figure_4_14(system: CamFollower) -> "pd.DataFrame":
    """Figure 4.14: permanent contact at 110 rpm, and the speed at which it ends."""
    rig = at_speed(system, rpm_to_rad_s(CONTACT_SPEED))
    angles = np.linspace(0, 2 * np.pi, 2001)
    load = np.asarray(contact_load(rig, angles))
    lift = np.asarray(rig.contact_angle(jnp.asarray(angles)))
    run = constrained_run(system)
    return frame(
        [
            ("period", 60 / CONTACT_SPEED, rig.period, "s"),
            ("impacts in two turns", 0, run.impacts.count, ""),
            ("least contact torque (4.10)", _NAN, load.min(), "N m"),
            ("largest contact torque (4.10)", _NAN, load.max(), "N m"),
            ("lowest angle of contact", _NAN, lift.min(), "rad"),
            ("highest angle of contact", _NAN, lift.max(), "rad"),
            ("detachment", DETACHMENT, rad_s_to_rpm(float_speed(rig).speed), "rpm"),
        ]
    )


def figure_4_15(system: CamFollower) -> "pd.DataFrame":
    """Figure 4.15: restitution by speed, beside what Table 5.2 implies.

    The line itself is not printed; the product of the two multipliers of an orbit with
    one impact is r^2.
    """
    rows = []
    for rpm, product in zip(SPEEDS, PRODUCTS, strict=True):
        law = system.restitution(rpm_to_rad_s(rpm), jnp.zeros(()))  # pyright: ignore
        rows.append((f"r at {rpm:.6f} rpm", np.sqrt(product), law, ""))
    return frame(rows)


def figure_4_16(system: CamFollower) -> "pd.DataFrame":
    """Figure 4.16, simulated part: the bounces of a turn at four speeds.

    Heights are angles over the cam; their ratio shows what an impact leaves.
    """
    rows = []
    for rpm in BOUNCES:
        run = released_turn(system, rpm)
        times = np.asarray(run.impacts.time)
        edges = np.append(float(run.t0), times[: min(3, len(times))])
        heights = []
        for start, end in zip(edges[:-1], edges[1:], strict=True):
            heights.append(float(np.max(run.gap(np.linspace(start, end, 200)[1:-1]))))
        rows.append((f"{rpm:g} rpm: first flight's height", _NAN, heights[0], "rad"))
        for k, height in enumerate(heights[1:]):
            name = f"{rpm:g} rpm: bounce {k + 1} over the flight before"
            rows.append((name, _NAN, height / heights[k], ""))
        rows.append((f"{rpm:g} rpm: sticking time", _NAN, sticking_time(run), "s"))
    return frame(rows)
