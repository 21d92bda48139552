"""The rigs that hidden effects are added to: those in `docs/rigs`, a cam-follower."""

import math
from typing import Any, NamedTuple

import numpy as np

from benchmarks import _cam_with_effects
from benchmarks._hidden_physics import Effect, Hidden
from benchmarks._own_rig_makers import made_case, MAKERS, Motion
from benchmarks._verdicts import SETTLE
from benchmarks.coverage import measure, random_rig
from benchmarks.own_rigs import drawn, RIGS
from jaxcam.data import DEMO_RIG
from jaxcam.fitting import read_setup
from jaxcam.recordings import read_rig, Recording


DURATION = 6.0
_CAM = "cam_follower"
NAMES = (_CAM, *sorted(MAKERS))
# Ranges from which the speed of each record of the cam-follower is drawn (rpm)
_SPANS_RPM = ((128, 140), (140, 148), (141, 149), (150, 158), (158, 173), (160, 178))
_INTERVAL, _CAM_DURATION = 5e-4, 4.0


class MadeRig(NamedTuple):
    """A rig of which recordings can be made.

    `given` is what `diagnose` takes, and `centre` the position at which a nonlinear
    spring of the library exerts no force.
    """

    name: str
    given: Any
    noise: float
    centre: float
    driven: bool
    struck: bool

    @property
    def duration(self) -> float:
        return _CAM_DURATION if self.name == _CAM else DURATION

    def admits(self, effect: Effect) -> bool:
        """Whether the rig has what an effect depends on."""
        if effect.kind in ("restitution", "surface"):
            return self.struck
        return self.driven or "phase" not in effect.arguments

    def drawn(self, rng):
        """A random rig within the tolerances."""
        if self.name == _CAM:
            return random_rig(self.given, rng)
        return drawn(self.given, rng)

    def made(self, truth, rng, hidden: Hidden | None) -> list[tuple[Recording, Motion]]:
        """Recordings with an effect, and the motions behind them.

        **Raises:** `Accumulates` if a rig other than the cam-follower comes to rest on
        a constraint.
        """
        if self.name == _CAM:
            return [
                self._cam_record(truth, rng, hidden, f"run{run}", span)
                for run, span in enumerate(_SPANS_RPM, start=1)
            ]
        return made_case(self.name, self.given, truth, rng, hidden, DURATION)

    def _cam_record(self, truth, rng, hidden, name: str, span):
        sensors = self.given.sensors
        speed = rng.uniform(*span) * math.pi / 30
        rows, struck = _cam_with_effects.run(
            truth, hidden, speed, _CAM_DURATION, SETTLE, _INTERVAL
        )
        turned, angle, velocity = rows.T
        time = _INTERVAL * np.arange(len(rows))
        shown = angle
        if hidden is not None and hidden.effect.kind == "sensor":
            shown = angle + hidden.at(angle, velocity, turned, time)
        whole = 2 * np.pi * np.floor(turned[0] / (2 * np.pi))
        channels = {
            "cam_angle_rad": measure(
                turned - whole, sensors.cam_noise, sensors.cam_counts_per_turn, rng
            ),
            "follower_angle_rad": measure(
                shown, sensors.follower_noise, sensors.follower_counts_per_turn, rng
            ),
        }
        states = np.stack([angle, velocity], axis=1)
        hertz = speed / (2 * math.pi)
        motion = Motion(time, states, turned, hertz, struck)
        return Recording(name, time, channels), motion


def made_rig(name: str) -> MadeRig:
    """One of the rigs in `NAMES`."""
    if name == _CAM:
        rig = read_rig(DEMO_RIG / "rig.toml")
        return MadeRig(name, rig, rig.sensors.follower_noise, 0.27, True, True)
    setup, maker = read_setup(RIGS / f"{name}.toml"), MAKERS[name]
    sensor = next(iter(setup.model.sensors.values()))
    centre = float(setup.references.get("spring_center", 0.0))
    driven, struck = maker.speeds is not None, bool(maker.impacts)
    return MadeRig(name, setup, float(sensor.noise), centre, driven, struck)
