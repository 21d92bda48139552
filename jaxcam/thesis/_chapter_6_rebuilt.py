"""Figures 6.14 to 6.16: the section after a deviation, predicted and simulated."""

from typing import NamedTuple, TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from variational import (
    composed_map,
    ComposedMap,
    section_turn,
    simulated_at_section,
    simulated_by_parameter,
)

from ..models import CamFollower, rpm_to_rad_s
from ._chatter import (
    interruption,
    pick_speed,
)
from ._frame import frame
from ._remember import remembered
from ._table_6_3 import ANGLE, nearest_impact, VELOCITY


if TYPE_CHECKING:
    import pandas as pd


_NAN = float("nan")
#: time of D* from release (s), and the impact that the composed map starts from
_START, _RANK = -0.00194, 37
#: of Figure 6.15: largest change of the speed (rpm)
_CHANGE = 0.001 * 152.67


class Rebuilt(NamedTuple):
    """Deviations, and what is at the section: predicted and simulated, `(k, 2)`."""

    deviations: np.ndarray
    predicted: np.ndarray
    simulated: np.ndarray
    composed: ComposedMap


def _composed(system: CamFollower, late: bool) -> tuple[CamFollower, ComposedMap]:
    rig = interruption(system)
    if late:
        return rig, composed_map(rig, pick_speed, _RANK)
    first = composed_map(rig, pick_speed, 0)
    rank = nearest_impact(rig, float(first.frame.release), _START)
    return rig, composed_map(rig, pick_speed, rank)


@remembered
def rebuilt_state(system: CamFollower) -> Rebuilt:
    """Figure 6.14: the rebound speed of D* is changed."""
    rig, composed = _composed(system, late=False)
    bar = float(composed.lambda_bar)
    lam = np.linspace(0.85 * bar, 0.40, 400)
    change = jnp.asarray((lam - bar) / float(composed.covector[0]))
    predicted = np.asarray(composed.at_section(change))  # pyright: ignore
    section = simulated_at_section(rig, composed, change)
    simulated = np.stack([np.asarray(section.gap), np.asarray(section.velocity)], 1)
    return Rebuilt(np.asarray(change), predicted, simulated, composed)


@remembered
def rebuilt_parameter(system: CamFollower) -> Rebuilt:
    """Figure 6.15: the speed of the cam is changed (rpm)."""
    rig, composed = _composed(system, late=True)
    change = np.linspace(-_CHANGE, _CHANGE, 401)
    rates = jnp.asarray(rpm_to_rad_s(change))
    predicted = np.asarray(composed.along_parameter(rates))
    section = simulated_by_parameter(rig, pick_speed, rates)
    simulated = np.stack([np.asarray(section.gap), np.asarray(section.velocity)], 1)
    return Rebuilt(change, predicted, simulated, composed)


@remembered
def rebuilt_turn(system: CamFollower) -> Rebuilt:
    """Figure 6.16: a whole turn, from a deviation (rad) along B to the next section."""
    rig, composed = _composed(system, late=True)
    change = np.linspace(-2e-5, 1e-4, 400)
    epsilon = jnp.asarray(change) / composed.vector[0]
    after = composed(epsilon)
    predicted = np.asarray(
        composed.relative + after[:, None] * composed.relative_vector
    )
    states = composed.state + epsilon[:, None] * composed.vector
    section = _turns(rig, states)
    simulated = np.stack([np.asarray(section.gap), np.asarray(section.velocity)], 1)
    return Rebuilt(change, predicted, simulated, composed)


@eqx.filter_jit
def _turns(rig, states):
    return jax.vmap(lambda state: section_turn(rig, state))(states)


def _error(found: Rebuilt) -> float:
    """Median error of the predicted velocity over its range where it was simulated."""
    velocity = found.simulated[:, 1]
    range_ = float(np.ptp(velocity))
    return float(np.median(np.abs(found.predicted[:, 1] - velocity))) / range_


def _lobe_rows(found):
    """What a prediction misses of the lobes, and how high they are."""
    return [
        ("median error over the range of the velocity", _NAN, _error(found), ""),
        (
            "largest velocity of the lobes, simulated",
            _NAN,
            found.simulated[:, 1].max(),
            "rad/s",
        ),
        ("the same, predicted", _NAN, np.nanmax(found.predicted[:, 1]), "rad/s"),
    ]


def figure_6_14(system: CamFollower) -> "pd.DataFrame":
    """Figure 6.14: prediction and simulation after D* has been moved."""
    found = rebuilt_state(system)
    return frame(_lobe_rows(found))


def figure_6_15(system: CamFollower) -> "pd.DataFrame":
    """Figure 6.15: prediction and simulation after the speed has been changed.

    Below the interruption the motion depends on the speed through release alone: the
    slopes there are those of Table 6.3, here from simulations.
    """
    found = rebuilt_parameter(system)
    below = found.deviations < -0.02
    angle, velocity = (
        np.polyfit(found.deviations[below], found.simulated[below, k], 1)[0]
        for k in (0, 1)
    )
    return frame(
        [
            ("velocity at the section by the speed", VELOCITY, velocity, "rad/s/rpm"),
            ("angle at the section by the speed", ANGLE, angle, "rad/rpm"),
            ("median error over the range of the velocity", _NAN, _error(found), ""),
        ]
    )


def figure_6_16(system: CamFollower) -> "pd.DataFrame":
    """Figure 6.16: a whole turn by the composed map, without any compensation."""
    found = rebuilt_turn(system)
    return frame(_lobe_rows(found))
