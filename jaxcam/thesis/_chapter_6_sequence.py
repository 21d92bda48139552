"""Figures 6.5 to 6.12: the lambda-map beside one chattering sequence."""

from typing import Any, NamedTuple, TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np

from variational import (
    ChatterFrame,
    hop_ratio,
    lambda_map,
    scaling_law,
)

from ..hybrid import contact_state, normal_acceleration, simulate, Trajectory
from ..models import CamFollower
from ._chatter import (
    accumulation_of,
    impacts_from_release,
    interruption,
    reference,
)
from ._frame import frame
from ._orbits import NEAR_CAM
from ._remember import remembered
from ._table_5_3 import M, Q
from ._table_6_1 import ACCUMULATION, RELEASE, SECTION_RELATIVE
from ._table_6_2 import JERK, SPEED


if TYPE_CHECKING:
    import pandas as pd


_NAN = float("nan")


def restitution_at(system: CamFollower) -> float:
    """Restitution at the interruption."""
    rig = interruption(system)
    return float(rig.restitution(rig.speed, jnp.zeros(())))  # pyright: ignore


def figure_6_5(system: CamFollower) -> "pd.DataFrame":
    """Figure 6.5: fixed points of f, slopes there; scales beside Table 5.3's."""
    r = restitution_at(system)
    law = scaling_law(r)
    slope = jax.grad(lambda lam: lambda_map(lam, r))
    return frame(
        [
            ("f at zero", 0.0, lambda_map(0.0, r), ""),
            ("slope of f at zero, beside r", r, slope(1e-9), ""),
            ("lambda-bar", _NAN, law.lambda_bar, ""),
            (
                "f at lambda-bar less lambda-bar",
                0.0,
                lambda_map(law.lambda_bar, r) - law.lambda_bar,
                "",
            ),
            (
                "slope there, beside e^-M of Table 5.3",
                np.exp(-M),
                slope(law.lambda_bar),
                "",
            ),
            ("p^2, beside e^Q of Table 5.3", np.exp(Q), law.p**2, ""),
            ("largest lambda that returns", 3 / 8, _largest(r), ""),
        ]
    )


def _largest(r) -> float:
    """Where the lambda-map stops being a number."""
    low, high = 0.34, 0.5
    for _ in range(60):
        middle = (low + high) / 2
        there = bool(jnp.isfinite(lambda_map(middle, r)))
        low, high = (middle, high) if there else (low, middle)
    return low


class Sequence(NamedTuple):
    """The impacts of the sticking orbit below its interruption."""

    system: CamFollower
    frame: ChatterFrame
    #: (k,) from release (s), rebound speeds (rad/s)
    tau: np.ndarray
    speed: np.ndarray
    #: from release (s)
    accumulation: float


@remembered
def sequence(system: CamFollower) -> Sequence:
    """Impacts as far below the interruption as Table 6.1."""
    rig = reference(system)
    orbit = accumulation_of(rig)
    impacts = impacts_from_release(rig, 40)
    end = float(orbit.frame.release) + float(rig.period)
    found = np.asarray(impacts.found)
    tau = np.asarray(impacts.time)[found] - end
    speed = np.asarray(impacts.speed)[found]
    early = tau < 0
    rest = float(orbit.accumulation) - end
    return Sequence(rig, orbit.frame, tau[early], speed[early], rest)


def hops(found: Sequence, start: int, count: int) -> np.ndarray:
    """Times from release of impacts after one of the sequence, by the lambda-map."""
    r, tau = float(found.frame.restitution), float(found.tau[start])
    lam = jnp.asarray(found.speed[start] / (found.frame.jerk * tau * tau))
    made = [tau]
    for _ in range(count):
        tau *= float(hop_ratio(lam))
        lam = lambda_map(lam, r)
        made.append(tau)
    return np.array(made)


def figure_6_6(system: CamFollower) -> "pd.DataFrame":
    """Figure 6.6: tau of each impact over the one before, by h(lambda) and exact."""
    found = sequence(system)
    rows: list[tuple[str, Any, Any, str]] = []
    for k in range(min(len(found.tau) - 1, 12)):
        lam = found.speed[k] / (found.frame.jerk * found.tau[k] ** 2)
        if lam > 1 / 3:
            continue
        rows.append(
            (
                f"tau of impact {k + 2} over impact {k + 1}, h beside exact",
                hop_ratio(jnp.asarray(lam)),
                found.tau[k + 1] / found.tau[k],
                "",
            )
        )
    return frame(rows)


#: impacts that Figure 6.11 predicts
_AHEAD = 6


def local_impacts(system: CamFollower) -> tuple[Sequence, int]:
    """The sequence, and the impact of Table 6.2 in it, found by its rebound speed."""
    found = sequence(system)
    return found, int(np.argmin(np.abs(np.log(found.speed / SPEED))))


def figure_6_11(system: CamFollower) -> "pd.DataFrame":
    """Figure 6.11: impacts predicted by the lambda-map beside the simulated ones."""
    found, start = local_impacts(system)
    rows: list[tuple[str, Any, Any, str]] = []
    count = min(_AHEAD, len(found.tau) - 1 - start)
    for k, tau in enumerate(hops(found, start, count)[1:]):
        exact = found.tau[start + k + 1]
        rows.append(
            (f"impact {k + 1} from release, map beside motion", exact, tau, "s")
        )
    end = hops(found, start, 60)[-1]
    rows.append(("accumulation from release, the same", found.accumulation, end, "s"))
    return frame(rows)


@remembered
def sticking_turn(system: CamFollower) -> Trajectory:
    """The orbit of Figures 6.7, 6.9 and 6.10: two turns from time zero."""
    rig = reference(system)
    run = simulate(rig, None, 0.0, 12 * float(rig.period))
    period = float(rig.period)
    return simulate(rig, run.at(np.array([10 * period]))[0], 0.0, 2 * period)


def figure_6_9(system: CamFollower) -> "pd.DataFrame":
    """Figures 6.7 and 6.9: where the markers lie on the orbit of 152.67 rpm."""
    run, found = sticking_turn(system), sequence(system)
    period = float(found.system.period)
    release = float(found.frame.release) % period
    state = np.asarray(run.at(np.array([period])))[0]
    cam = contact_state(
        found.system.prepared(), jnp.asarray([period]), jnp.array(NEAR_CAM)
    )[0]
    return frame(
        [
            ("triangle: time", ACCUMULATION[0], release + found.accumulation, "s"),
            ("diamond: time", RELEASE[0], release, "s"),
            ("square: relative angle", SECTION_RELATIVE[0], state[0] - cam[0], "rad"),
            (
                "square: relative velocity",
                SECTION_RELATIVE[1],
                state[1] - cam[1],
                "rad/s",
            ),
        ]
    )


@remembered
def contact_derivatives(system: CamFollower):
    """Time over a turn (s); relative acceleration and jerk in contact."""
    found = sequence(system)
    rig = found.system.prepared()
    times = jnp.linspace(0.0, float(rig.period), 2001)

    def acceleration(t):
        state = contact_state(rig, t[None], jnp.array(NEAR_CAM))[0]
        return normal_acceleration(rig, t, state)[0]

    both = jax.vmap(lambda t: jax.jvp(acceleration, (t,), (jnp.ones_like(t),)))(times)
    return tuple(np.asarray(v) for v in (times, *both))


def figure_6_12(system: CamFollower) -> "pd.DataFrame":
    """Figure 6.12: the jerk where the relative acceleration is zero."""
    times, acceleration, jerk = contact_derivatives(system)
    k = np.flatnonzero((acceleration[:-1] < 0) & (acceleration[1:] >= 0))
    release, c = _NAN, _NAN
    if len(k):
        share = -acceleration[k[0]] / (acceleration[k[0] + 1] - acceleration[k[0]])
        release = times[k[0]] + share * (times[1] - times[0])
        c = jerk[k[0]] + share * (jerk[k[0] + 1] - jerk[k[0]])
    return frame(
        [
            ("c, the jerk at zero acceleration", JERK, c, "rad/s^3"),
            ("time of it", RELEASE[0], release, "s"),
            ("c, from the release point", JERK, sequence(system).frame.jerk, "rad/s^3"),
        ]
    )
