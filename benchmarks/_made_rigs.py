"""The rigs that hidden effects are added to: those in `docs/rigs`, a cam-follower."""

import importlib
from collections.abc import Sequence
from typing import Any, NamedTuple

from benchmarks._hidden_physics import Effect, Hidden
from benchmarks._own_rig_makers import made_case, MAKERS, Motion
from benchmarks.coverage import random_rig
from benchmarks.own_rigs import drawn, RIGS
from jaxcam.data import DEMO_RIG
from jaxcam.fitting import read_setup
from jaxcam.recordings import read_rig, Recording


_DURATION = 6.0
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
        return _cam().DURATION if self.name == _CAM else _DURATION

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

    def made(
        self, truth, rng, hidden: Sequence[Hidden] = ()
    ) -> list[tuple[Recording, Motion]]:
        """Recordings with effects, and the motions behind them.

        **Raises:** `Accumulates` if a rig other than the cam-follower comes to rest on
        a constraint.
        """
        if self.name == _CAM:
            return _cam().made(self.given, truth, rng, hidden)
        return made_case(self.name, self.given, truth, rng, hidden, _DURATION)


def _cam():
    """Imported on demand: the other rigs do without numba, which tests do not need."""
    return importlib.import_module("benchmarks._made_cam")


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
