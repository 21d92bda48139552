"""The rigs that hidden effects are added to: those in `docs/rigs`, a cam-follower."""

import math
from typing import Any, NamedTuple

import numpy as np

from benchmarks import _cam_with_effects
from benchmarks._hidden_physics import Effect, Hidden
from benchmarks._numba_rig import Samples
from benchmarks._own_rig_makers import made_case, MAKERS, Motion
from benchmarks._verdicts import SETTLE
from benchmarks.coverage import random_rig, recording
from benchmarks.fresh import DURATION as CAM_DURATION, SPANS_RPM
from benchmarks.own_rigs import drawn, RIGS
from jaxcam.data import DEMO_RIG
from jaxcam.fitting import read_setup
from jaxcam.recordings import read_rig, Recording


_DURATION, _INTERVAL = 6.0, 5e-4
_CAM = "cam_follower"
NAMES = (_CAM, *sorted(MAKERS))


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
        return CAM_DURATION if self.name == _CAM else _DURATION

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
                for run, span in enumerate(SPANS_RPM, start=1)
            ]
        return made_case(self.name, self.given, truth, rng, hidden, _DURATION)

    def _cam_record(self, truth, rng, hidden, name: str, span):
        speed = rng.uniform(*span) * math.pi / 30
        rows, struck = _cam_with_effects.run(
            truth, hidden, speed, CAM_DURATION, SETTLE, _INTERVAL
        )
        turned, angle, velocity = rows.T
        time = _INTERVAL * np.arange(len(rows))
        shown = angle
        if hidden is not None and hidden.effect.kind == "sensor":
            shown = angle + hidden.at(angle, velocity, turned, time)
        states = np.stack([angle, velocity], axis=1)
        hertz = speed / (2 * math.pi)
        motion = Motion(time, states, turned, hertz, struck)
        samples = Samples(time, turned, shown)
        return recording(samples, self.given.sensors, name, rng), motion


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
