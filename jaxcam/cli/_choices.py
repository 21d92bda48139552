"""What can be chosen by name at the command line: systems and solvers."""

import difflib
import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from ..hybrid import HybridSystem


class Ready(NamedTuple):
    """A system with a name, and how it is started where nothing else is said."""

    model: str
    #: None is the release point
    state: tuple[float, ...] | None
    #: periods of the forcing, or else s
    turns: float | None
    duration: float


SYSTEMS = {
    "cam-follower": Ready("CamFollower", None, 10.0, 0.0),
    "impact-oscillator": Ready("ImpactOscillator", None, 10.0, 0.0),
    "bouncing-ball": Ready("BouncingBall", (1.0, 0.0), None, 3.0),
    "triple-integrator": Ready("TripleIntegrator", (0.0, 0.1, -2.0), None, 3.0),
}
SOLVERS = {
    "dopri8": "Dopri8",
    "tsit5": "Tsit5",
    "dopri5": "Dopri5",
    "kvaerno5": "Kvaerno5",
}
ENGINES = ("loop", "diffeqsolve")
CAM = "cam-follower"
# more names than these are not read
_LISTED = 20


def choose(option: str, name: str, known: Iterable[str]) -> str:
    """The name, if it is known. **Raises:** `ValueError` that lists those that are."""
    known = tuple(known)
    if name in known:
        return name
    some, words = known, "choose one of"
    if len(known) > _LISTED:
        some = difflib.get_close_matches(name, known, n=4, cutoff=0.3) or known[:4]
        words = f"choose one of the {len(known)} that --list shows, such as"
    raise ValueError(f"{option} is {name[:100]!r}; {words} {', '.join(some)}.")


def load(file: Path) -> HybridSystem:
    """The system in a file of `jaxcam fit` or `jaxcam diagnose`.

    **Raises:** `ValueError` that says what is wrong with it.
    """
    from ..discrepancy.terms import saved_classes
    from ..models import load_system

    return load_system(file, classes=saved_classes())


def saved_name(file: Path) -> str:
    """The name of the system in a file. **Raises:** `ValueError` for another one."""
    from ..discrepancy.terms import WithTerms

    system = load(file)
    model = type(system.base if isinstance(system, WithTerms) else system).__name__
    for name, ready in SYSTEMS.items():
        if ready.model == model:
            return name
    raise ValueError(f"{file}: it holds a {model}, which no command line knows.")


def system_name(name: str, saved: Path | None) -> str:
    """The name of a ready system, or of that in a file, which goes first."""
    return choose("SYSTEM", name if saved is None else saved_name(saved), SYSTEMS)


def make_system(
    name: str, preset: str | None, rpm: float | None, saved: Path | None = None
) -> HybridSystem:
    """A ready system; `preset` and a speed in rpm are for the cam-follower alone.

    **Arguments:** `saved` is a file with the system, as `jaxcam fit --json` and
    `jaxcam diagnose --out` write it.

    **Raises:** `ValueError` that names the fix.
    """
    import equinox as eqx
    import jax.numpy as jnp

    from .. import models

    if name != CAM:
        for option, value in (("--preset", preset), ("--speed", rpm)):
            if value is not None:
                raise ValueError(
                    f"{option} belongs to {CAM}; leave it out, and use --set for the "
                    f"parameters of {name}."
                )
        if saved is not None:
            return load(saved)
        return getattr(models, SYSTEMS[name].model)()
    if saved is not None and preset is not None:
        raise ValueError("Give --system or --preset, not both.")
    if saved is not None:
        system = load(saved)
    else:
        system = models.CamFollower() if preset is None else models.preset(preset)
    if rpm is not None:
        if not 0 < rpm < math.inf:
            raise ValueError(f"--speed is {rpm:g} rpm; give a positive number.")
        speed = jnp.asarray(models.rpm_to_rad_s(rpm), dtype=float)
        system = eqx.tree_at(lambda s: s.speed, system, speed)
    return system


def make_solver(name: str):
    """A diffrax solver. **Raises:** `ValueError` that lists the names."""
    import diffrax

    return getattr(diffrax, SOLVERS[choose("--solver", name, SOLVERS)])()
