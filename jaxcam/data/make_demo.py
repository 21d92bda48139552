"""Make the simulated recordings of the demonstration rig.

    python -m jaxcam.data.make_demo

The rig is simulated here with a scalar Runge-Kutta loop that is independent of
`jaxcam.hybrid`, so that the comparison is meaningful. The rig has viscous friction in
its hinge, which the textbook model lacks; the speed of its drive drifts, and its
encoders are noisy.
"""

import dataclasses
import gzip
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np


# Penetration (rad) up to which a gap that has just opened does not count as closed
_ROUNDING = 1e-13
# interval between two samples, and the longest integration step (s)
_INTERVAL = 5e-4


@dataclasses.dataclass(frozen=True)
class RealRig:
    """The true parameters of a rig, which differ from its rig file (SI units).

    - `height`: cam radius plus half height of the follower (m).
    - `damping`: viscous damping of the follower divided by its inertia (1/s).
    - `wander`: slow relative variation of the cam speed.
    """

    height: float = 0.0663
    eccentricity: float = 0.01505
    center_x: float = 0.249
    center_y: float = 0.0002
    half_height: float = 0.0206
    stiffness_over_inertia: float = 2465.0
    spring_hook_x: float = -0.0313
    spring_elongation: float = 0.1722
    restitution: float = 0.56
    damping: float = 0.3
    wander: float = 2e-4

    def acceleration(self, angle: float, velocity: float) -> float:
        """Return the acceleration (rad/s^2) of the free follower due to the spring
        (thesis, eq. 4.9) and the viscous hinge.
        """
        sine, secant = math.sin(angle), 1 / math.cos(angle)
        stretch = (self.spring_hook_x * sine + self.half_height) * secant
        arm = (self.spring_hook_x + self.half_height * sine) * secant**2
        torque = -self.stiffness_over_inertia * (stretch - self.spring_elongation) * arm
        return torque - self.damping * velocity

    def profile(self, harmonics: int = 14) -> np.ndarray:
        """Return the complex Fourier coefficients of the contact angle of a clockwise
        cam.
        """
        turned = 2 * np.pi * np.arange(256) / 256
        x = self.eccentricity * np.cos(turned) + self.center_x
        y = -self.eccentricity * np.sin(turned) + self.center_y
        contact = np.arcsin(self.height / np.hypot(x, y)) + np.arctan2(y, x)
        coefficients = 2 * np.fft.rfft(contact)[: harmonics + 1] / 256
        coefficients[0] /= 2
        return coefficients


@dataclasses.dataclass(frozen=True)
class Truth:
    """The true motion: samples, impacts, and contacts as pairs (landing, release)."""

    time: np.ndarray
    turned: np.ndarray
    angle: np.ndarray
    velocity: np.ndarray
    impact_time: np.ndarray
    approach: np.ndarray
    contacts: tuple[tuple[float, float], ...]


class _Cam:
    """The drive, and the contact angle as a function of time."""

    def __init__(self, rig: RealRig, speed: float):
        self.rig, self.speed = rig, speed
        self.coefficients = rig.profile()
        self.order = 1j * np.arange(len(self.coefficients))
        self.first = self.coefficients * self.order
        self.second = self.coefficients * self.order**2

    def drive(self, t):
        """Return the cam angle and its first and second derivatives."""
        angle, rate, change = self.speed * t, self.speed, 0.0
        for share, frequency in ((0.7, 0.31), (0.3, 0.87)):
            w, a = 2 * math.pi * frequency, self.rig.wander * self.speed * share
            angle += a / w * math.sin(w * t)
            rate += a * math.cos(w * t)
            change -= a * w * math.sin(w * t)
        return angle, rate, change

    def surface(self, t):
        """Return the angle, velocity and acceleration of a follower in contact."""
        angle, rate, change = self.drive(t)
        turn = np.exp(self.order * angle)
        slope, bend = (self.first @ turn).real, (self.second @ turn).real
        acceleration = bend * rate**2 + slope * change
        return float((self.coefficients @ turn).real), slope * rate, acceleration


class _Follower:
    """The follower's flights, impacts and contacts, starting slightly above the cam."""

    def __init__(self, rig: RealRig, cam: _Cam):
        self.rig, self.cam = rig, cam
        self.t, (self.x, self.v, _) = 0.0, cam.surface(0.0)
        self.x += 0.01
        self.resting, self.landed = False, 0.0
        # longest next step, shorter just after an impact: a flight must not end within
        # its first step
        self.longest = _INTERVAL
        self.impacts: list[tuple[float, float]] = []
        self.contacts: list[tuple[float, float]] = []

    def advance(self, target: float) -> None:
        while self.t < target:
            h = min(target - self.t, self.longest)
            if self.resting:
                self._rest(h, target)
                continue
            ahead, later = self._fly(h)
            if not self._inside(ahead, self.t + h):
                self.x, self.v, self.longest = ahead, later, _INTERVAL
                self._step(h, target)
                continue
            self._hit(
                _bisect(h, lambda part: self._inside(self._fly(part)[0], self.t + part))
            )

    def _step(self, h: float, target: float) -> None:
        self.t = target if h == target - self.t else self.t + h

    def _inside(self, x: float, t: float) -> bool:
        return bool(x < self.cam.surface(t)[0] - _ROUNDING)

    def _lifts(self, t: float) -> bool:
        """Return whether a follower at rest is pulled off the cam."""
        x, v, a = self.cam.surface(t)
        return bool(self.rig.acceleration(x, v) > a)

    def _fly(self, h: float) -> tuple[float, float]:
        """Return angle and velocity after a flight of duration h, by one Runge-Kutta
        step.
        """
        x, v, f = self.x, self.v, self.rig.acceleration
        a1 = f(x, v)
        v2 = v + h / 2 * a1
        a2 = f(x + h / 2 * v, v2)
        v3 = v + h / 2 * a2
        a3 = f(x + h / 2 * v2, v3)
        v4 = v + h * a3
        a4 = f(x + h * v3, v4)
        return (
            x + h / 6 * (v + 2 * v2 + 2 * v3 + v4),
            v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4),
        )

    def _rest(self, h: float, target: float) -> None:
        if self._lifts(self.t + h):
            self.t += _bisect(h, lambda part: self._lifts(self.t + part))
            self.resting = False
            self.contacts.append((self.landed, self.t))
        else:
            self._step(h, target)
        self.x, self.v, _ = self.cam.surface(self.t)

    def _hit(self, h: float) -> None:
        """Apply an impact after a flight of duration h, or begin contact if the
        remaining flights are very short.
        """
        r = self.rig.restitution
        _, before = self._fly(h)
        self.t += h
        self.x, rate, acceleration = self.cam.surface(self.t)
        approach = rate - before
        self.v = rate + r * approach
        self.impacts.append((self.t, approach))
        pull = acceleration - self.rig.acceleration(self.x, self.v)
        flight = 2 * r * approach / pull if pull > 0 else _INTERVAL
        # the total duration of the remaining flights is flight / (1 - r)
        if 0 < flight < 1e-6 * (1 - r):
            self.resting, self.landed = True, self.t
            self.v, self.longest = rate, _INTERVAL
        else:
            self.longest = min(_INTERVAL, max(flight / 2, 1e-8))


def _bisect(h: float, crossed: Callable[[float], bool]) -> float:
    """Return the earliest time in (0, h] from which a condition holds, given that it
    holds at h.
    """
    low, high = 0.0, h
    for _ in range(45):
        middle = (low + high) / 2
        low, high = (low, middle) if crossed(middle) else (middle, high)
    return high


def simulate_rig(
    rig: RealRig,
    speed: float,
    duration: float,
    *,
    settle: float = 20.0,
) -> Truth:
    """Simulate the rig at `speed` (rad/s) and keep the last `duration` (s)."""
    cam = _Cam(rig, speed)
    follower = _Follower(rig, cam)
    total = round((settle + duration) / _INTERVAL)
    rows = []
    for sample in range(total):
        t = follower.t
        rows.append((t, cam.drive(t)[0], follower.x, follower.v))
        follower.advance((sample + 1) * _INTERVAL)
    start = total - round(duration / _INTERVAL)
    time, turned, angle, velocity = np.array(rows[start:]).T
    begin = time[0]
    hits = np.array(follower.impacts).reshape(-1, 2)
    hits = hits[hits[:, 0] >= begin]
    kept = tuple((a - begin, b - begin) for a, b in follower.contacts if b > begin)
    return Truth(
        time - begin, turned, angle, velocity, hits[:, 0] - begin, hits[:, 1], kept
    )


def measure(samples: np.ndarray, noise: float, counts: int, rng) -> np.ndarray:
    """Simulate an encoder: noise, then a whole number of counts."""
    step = 2 * math.pi / counts
    return np.round((samples + noise * rng.standard_normal(len(samples))) / step) * step


def recording_text(truth: Truth, rng, *, sensors: Sequence[float]) -> str:
    """Return a recording as CSV; `sensors` are noise and counts of cam and follower."""
    cam_noise, cam_counts, noise, counts = sensors
    # as for an encoder that is zeroed once in the turn before the recording begins
    turned = truth.turned - 2 * np.pi * np.floor(truth.turned[0] / (2 * np.pi))
    columns = zip(
        truth.time,
        measure(turned, cam_noise, int(cam_counts), rng),
        measure(truth.angle, noise, int(counts), rng),
    )
    rows = [f"{t:.4f},{cam:.6f},{angle:.6f}" for t, cam, angle in columns]
    return "\n".join(["time_s,cam_angle_rad,follower_angle_rad", *rows, ""])


DEMO_SENSORS = (9e-5, 16384, 7e-5, 36000)
"""Noise (rad) and counts per turn of the two encoders of the demonstration rig."""
DEMO_SPEEDS_RPM = (136.5, 146.0, 158.0)


def main() -> None:
    """Write the runs of the demonstration rig next to its rig.toml."""
    folder = Path(__file__).parent / "demo_rig"
    rng = np.random.default_rng(20081)
    for number, rpm in enumerate(DEMO_SPEEDS_RPM, start=1):
        truth = simulate_rig(RealRig(), rpm * math.pi / 30, 4.0)
        text = recording_text(truth, rng, sensors=DEMO_SENSORS)
        file = folder / f"run{number}_{rpm:.1f}rpm.csv.gz"
        # no time stamp, so that the files are reproducible
        file.write_bytes(gzip.compress(text.encode(), 9, mtime=0))
        print(f"{file.name}: {file.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
