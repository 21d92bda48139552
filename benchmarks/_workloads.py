"""The two workloads of the speed comparison, and the cam-follower they run on.

The code is plain numpy and is shared by all sides of the comparison, so that they start
from the same numbers. The system has the parameters of Table 4.4, with the cam turning
clockwise: cam angle `theta = -speed * t`, follower state `(angle, velocity)` in rad and
rad/s.
"""

from dataclasses import dataclass

import numpy as np


# Table 4.4, SI units.
CAM_RADIUS = 0.045
ECCENTRICITY = 0.015
CENTRE = (0.249, 0.0)
HALF_HEIGHT = 0.021
INERTIA = 0.043
STIFFNESS = 105.0
SPRING_X = -0.031
SPRING_REACH = 0.173

# A chatter sequence is completed when |jerk| u < CHATTER (1 - r) acceleration^2, u
# being the relative speed just after the impact.
CHATTER = 1e-3


@dataclass(frozen=True)
class Workload:
    """The trajectories of one run; every array has shape (lanes,), except `start`
    (lanes, 2).
    """

    name: str
    speed: np.ndarray
    restitution: np.ndarray
    start: np.ndarray
    turns: int

    @property
    def lane_turns(self) -> int:
        return len(self.speed) * self.turns


def restitution(speed):
    """Coefficient of restitution at a cam speed in rad/s, from Table 5.2."""
    rpm = np.asarray(speed) * 30 / np.pi
    return np.clip(0.00795658 * rpm - 0.62122908, 0.0, 1.0)


def contact_angle(theta):
    """Follower angle (rad) in contact with the cam at angle `theta` (thesis, eq.
    (4.23)).
    """
    x = ECCENTRICITY * np.cos(theta) + CENTRE[0]
    y = ECCENTRICITY * np.sin(theta) + CENTRE[1]
    return np.arcsin((HALF_HEIGHT + CAM_RADIUS) / np.hypot(x, y)) + np.arctan2(y, x)


def _cam_coefficients(harmonics: int = 16) -> np.ndarray:
    """Complex C with contact_angle(theta) = Re sum_n C[n] exp(i n theta)."""
    samples = 128
    spectrum = np.fft.rfft(contact_angle(2 * np.pi * np.arange(samples) / samples))
    spectrum = spectrum[: harmonics + 1] * 2 / samples
    spectrum[0] /= 2
    return spectrum


CAM_COEFFICIENTS = _cam_coefficients()


def cam(theta, order: int = 0):
    """Derivative of any order of the contact angle with respect to the cam angle."""
    n = np.arange(len(CAM_COEFFICIENTS))
    wave, total = np.exp(1j * np.asarray(theta)), 0.0
    for coefficient in (CAM_COEFFICIENTS * (1j * n) ** order)[::-1]:
        total = total * wave + coefficient
    return total.real


def spring(angle):
    """Angular acceleration of the free follower in rad/s^2 (thesis, eq. (4.9))."""
    s, c = np.sin(angle), np.cos(angle)
    stretch = (SPRING_X * s + HALF_HEIGHT) / c - SPRING_REACH
    return -STIFFNESS / INERTIA * stretch * (SPRING_X + HALF_HEIGHT * s) / c**2


# Relative acceleration of a follower at rest on the cam at each phase: spring - speed^2
# cam.
_PHASES = np.linspace(0.0, 2 * np.pi, 721)
_REST_SPRING, _REST_CAM = spring(cam(-_PHASES)), cam(-_PHASES, 2)


def release_time(speed) -> np.ndarray:
    """First time in (0, period] at which a follower at rest on the cam is released.

    At this time, the relative acceleration crosses zero upward; the time is infinite if
    it never does. `speed` (lanes,) is in rad/s; the times (lanes,) are in s.
    """
    speed, back = np.unique(np.asarray(speed, float), return_inverse=True)
    values = _REST_SPRING - speed[:, None] ** 2 * _REST_CAM
    upward = (values[:, :-1] < 0) & (values[:, 1:] >= 0)
    first = np.argmax(upward, axis=1)
    lanes = np.arange(len(speed))
    p, value = _PHASES[first], values[lanes, first]
    q, other = _PHASES[first + 1], values[lanes, first + 1]
    for _ in range(5):
        # Secant method; it stops moving once both values agree.
        change = np.where(other != value, other - value, np.inf)
        p, value, q = q, other, q - other * (q - p) / change
        other = spring(cam(-q)) - speed**2 * cam(-q, 2)
    return np.where(upward.any(axis=1), q / speed, np.inf)[back].reshape(-1)


def sweep(lanes: int = 256, turns: int = 100) -> Workload:
    """W1: speeds from 130 to 160 rpm, each started at rest 0.02 rad above the cam at t
    = 0.
    """
    speed = np.linspace(130, 160, lanes) * np.pi / 30
    start = np.zeros((lanes, 2))
    start[:, 0] = contact_angle(0.0) + 0.02
    return Workload("W1", speed, restitution(speed), start, turns)


def grid(side: int = 128, turns: int = 30, rpm: float = 145.0) -> Workload:
    """W2: side x side initial states at one speed, as for basins of attraction."""
    speed = np.full(side * side, rpm * np.pi / 30)
    offset, velocity = np.meshgrid(
        np.linspace(0.001, 0.25, side), np.linspace(-3.0, 3.0, side), indexing="ij"
    )
    start = np.stack([contact_angle(0.0) + offset.ravel(), velocity.ravel()], axis=1)
    return Workload("W2", speed, restitution(speed), start, turns)


def single(rpm: float = 145.0, turns: int = 300) -> Workload:
    """One trajectory, started as in `sweep`."""
    speed = np.array([rpm * np.pi / 30])
    start = np.array([[contact_angle(0.0) + 0.02, 0.0]])
    return Workload(f"single {rpm:g} rpm", speed, restitution(speed), start, turns)
