"""Read the rig file of a cam-follower, with units and precise error messages."""

import dataclasses
from pathlib import Path
from typing import Any

from .._errors import RigError
from .._rig import Gyro, References, Rig, Sensors
from ._read_layout import LAYOUT_KEYS
from ._toml import known_keys, read_tables, Section


def read_rig(file: str | Path) -> Rig:
    """Read the rig described in a TOML file.

    A quantity is `{value = 0.045, tolerance = 0.002, unit = "m"}` or a bare number;
    `unit` is optional and must be the SI unit.

    Args:
        file: The file.

    Returns:
        A [`jaxcam.recordings.Rig`][].

    Raises:
        RigError: The file cannot be used; the message names the file and the key.

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.recordings import read_rig
        >>> read_rig(DEMO_RIG / "rig.toml").inertia.value > 0
        True
    """
    file = Path(file)
    tables = read_tables(file)
    known = ("geometry", "dynamics", "impact", "sensors", "references")
    known_keys(file, "", tables, (*known, *LAYOUT_KEYS))
    geometry = Section(file, "geometry", tables)
    dynamics = Section(file, "dynamics", tables)
    impact = Section(file, "impact", tables)
    center_x, center_y = geometry.pair("cam_center", "m")
    rig = Rig(
        cam_radius=geometry.quantity("cam_radius", "m"),
        cam_eccentricity=geometry.quantity("cam_eccentricity", "m"),
        cam_center_x=center_x,
        cam_center_y=center_y,
        follower_half_height=geometry.quantity("follower_half_height", "m"),
        cam_rotation=geometry.choice("cam_rotation", "clockwise", "counterclockwise"),
        inertia=dynamics.quantity("inertia", "kg m^2"),
        spring_stiffness=dynamics.quantity("spring_stiffness", "N/m"),
        spring_hook_x=dynamics.quantity("spring_hook_x", "m"),
        spring_elongation=dynamics.quantity("spring_elongation", "m"),
        restitution=impact.quantity("restitution", ""),
        sensors=_sensors(Section(file, "sensors", tables)),
        references=References(**read_references(file, tables, "rad")),
    )
    for section in (geometry, dynamics, impact):
        section.done()
    try:
        rig.system(speed=10.0).check()
    except ValueError as error:
        raise RigError(f"{file}: {error}") from None
    return rig


def _sensors(section: Section) -> Sensors:
    gyro = None
    if "gyro" in section.table:
        inner = Section(section.file, "gyro", section.table)
        names = [field.name for field in dataclasses.fields(Gyro)]
        gyro = Gyro(**{name: inner.positive(name, "") for name in names})
        inner.done()
        section.read.append("gyro")
    sensors = Sensors(
        sample_rate=section.positive("sample_rate", "Hz"),
        cam_counts_per_turn=section.count("cam_counts_per_turn"),
        follower_counts_per_turn=section.count("follower_counts_per_turn"),
        cam_noise=section.positive("cam_noise", "rad"),
        follower_noise=section.positive("follower_noise", "rad"),
        gyro=gyro,
    )
    section.done()
    return sensors


def read_references(
    file: Path, tables: dict[str, Any], unit: str | None
) -> dict[str, float]:
    """Return the constants of missing-physics terms in the table `[references]`, by
    name.

    **Arguments:** the unit of the motion, from which the unit of speed follows; `None`
    allows any unit.

    **Raises:** `RigError` for an unknown name, or a speed that is not positive.
    """
    if "references" not in tables:
        return {}
    section = Section(file, "references", tables)
    names = [field.name for field in dataclasses.fields(References)]
    known_keys(file, "references", section.table, names)
    found = {}
    for name in section.table:
        if name.endswith("_speed"):
            found[name] = section.positive(name, unit and f"{unit}/s")
        else:
            found[name] = section.quantity(name, unit).value
    return found
