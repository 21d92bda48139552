"""The system that a command uses: built-in, saved, or defined in a user's file."""

import dataclasses
import math
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

import numpy as np
import typer

from ..hybrid import HybridSystem
from ._choices import CAM, choose, SYSTEMS
from ._options import SavedSystem


if TYPE_CHECKING:
    from ..fitting import Setup


@dataclasses.dataclass(frozen=True)
class Source:
    """A saved or user-defined system, given by `--system` and `--rig`."""

    saved: SavedSystem = None
    rig: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="A rig file with nominal values; see jaxcam new-rig."
        ),
    ] = None

    def __bool__(self) -> bool:
        return self.saved is not None or self.rig is not None

    def system(self) -> HybridSystem:
        """Return the saved system, or the system of a Python file with nominal values.

        Raises:
            ValueError: A file is invalid; the message names it and says how to fix it.
        """
        from ..fitting import is_setup, read_setup
        from ..fitting.own_systems import stated_system, system_class
        from ._saved_system import load_saved

        named = None if self.saved is None else str(self.saved)
        coded = named is not None and _is_code(named)
        if self.rig is None:
            assert self.saved is not None
            if not coded:
                return load_saved(self.saved)
            return stated_system(self.saved, system_class(str(self.saved)), {})
        if named is not None and not coded:
            raise ValueError(
                f"{named} already contains parameter values; leave out --rig, or give "
                "--system FILE.py:CLASS."
            )
        if coded or is_setup(self.rig):
            return read_setup(self.rig, named).model.system
        from ..models import CamFollower
        from ..recordings import read_rig

        return read_rig(self.rig).system(float(CamFollower().speed))

    def units(self) -> dict[str, str]:
        """Return the units stated in the rig file, by parameter name."""
        setup = self._setup()
        return {} if setup is None else dict(setup.units)

    def start(self) -> np.ndarray | None:
        """Return the initial state stated in the rig file, or None."""
        setup = self._setup()
        return None if setup is None or not setup.start else np.array(setup.start)

    def _setup(self) -> "Setup | None":
        """Return the content of the rig file of a user's system, or None."""
        from ..fitting import is_setup, read_setup

        if self.rig is None or not is_setup(self.rig):
            return None
        return read_setup(self.rig, None if self.saved is None else str(self.saved))

    def name(self, word: str) -> str:
        """Return the name of the system: `word`, unless a file defines the system.

        Raises:
            ValueError: The name is unknown, or the file is invalid.
        """
        if not self:
            if _is_code(word):
                raise ValueError(
                    f"{word[:100]}: give a system of your own with --system."
                )
            return choose("SYSTEM", word, SYSTEMS)
        from ..discrepancy.terms import WithTerms

        system = self.system()
        model = type(system.base if isinstance(system, WithTerms) else system).__name__
        for name, ready in SYSTEMS.items():
            if ready.model == model:
                return name
        return model


def make_system(
    name: str, preset: str | None, rpm: float | None, source: Source = Source()
) -> HybridSystem:
    """Create a system; `preset` and a speed in rpm apply to the cam-follower only.

    Raises:
        ValueError: The options do not fit the system; the message says how to fix it.
    """
    import equinox as eqx
    import jax.numpy as jnp

    from .. import models

    if name != CAM:
        for option, value in (("--preset", preset), ("--speed", rpm)):
            if value is not None:
                raise ValueError(
                    f"{option} applies only to {CAM}; leave it out, and use --set for "
                    f"the parameters of {name}."
                )
        if source:
            return source.system()
        return getattr(models, SYSTEMS[name].model)()
    if source and preset is not None:
        raise ValueError("Give --system or --preset, not both.")
    if source:
        system = source.system()
    else:
        system = models.CamFollower() if preset is None else models.preset(preset)
    if rpm is not None:
        if not 0 < rpm < math.inf:
            raise ValueError(f"--speed is {rpm:g} rpm; give a positive number.")
        speed = jnp.asarray(models.rpm_to_rad_s(rpm), dtype=float)
        system = eqx.tree_at(lambda s: s.speed, system, speed)
    return system


def _is_code(named: str) -> bool:
    """Return whether a text names a Python file, with or without a class."""
    path, colon, _ = named.rpartition(":")
    return named.endswith(".py") or (bool(colon) and path.endswith(".py"))
