"""Two branches of the thesis rig for `jaxcam demo`: P(1,1) and P(inf,1)."""

import dataclasses
from pathlib import Path


# A state near the orbit with one impact per cycle at 145 rpm: angle (rad), velocity
# (rad/s)
_NEAR = (0.4245, 1.828)
_AT_RPM = 145.0
# Speed bounds (rpm) of the branches P(1,1) and P(inf,1)
_BOUNDS = ((130.0, 154.0), (115.0, 160.0))


@dataclasses.dataclass(frozen=True)
class Branches:
    """The branches as rows of a table with the columns `HEADINGS`, and as a figure."""

    rows: tuple[tuple[str, str, str, str], ...]
    figure: Path
    caption: str


HEADINGS = ("orbit", "event", "speed (rpm)", "largest multiplier (modulus)")
_CAPTION = (
    "Continuation for the cam-follower rig of the thesis (Alzate, 2008): follower "
    "angle, sampled once per cycle, against cam speed. Stable orbits are solid, "
    "unstable ones dashed. P(1,1) has one impact per cycle; P(inf,1) chatters, sticks "
    "and is released."
)


def _interrupted(point) -> bool:
    """Return whether a point is the interruption of chatter of the sticking orbit."""
    return point.kind == "interruption of chatter"


def follow_branches(folder: Path) -> Branches:
    """Follow both branches and draw them.

    This runs in a separate process, in parallel with other work, because compilation
    takes half a minute.
    """
    import equinox as eqx
    import jax.numpy as jnp
    import matplotlib

    import continuation

    from ..models import preset, rad_s_to_rpm, rpm_to_rad_s
    from ._cache import keep_compiled_programs

    keep_compiled_programs()
    matplotlib.use("Agg")
    from ..plotting import branch_diagram, save_figure

    def speed(system):
        return system.speed

    rig = eqx.tree_at(speed, preset("calibrated"), jnp.asarray(rpm_to_rad_s(_AT_RPM)))
    starts = (
        continuation.periodic_orbits(rig, jnp.asarray(_NEAR), periods=1),
        continuation.periodic_orbits(rig, continuation.periodic_orbit(rig)),
    )
    branches = [
        continuation.branch(
            start.problem,
            start,
            speed,
            (float(rpm_to_rad_s(low)), float(rpm_to_rad_s(high))),
            direction="both",
            callbacks=[_interrupted],
        )
        for start, (low, high) in zip(starts, _BOUNDS)
    ]
    rows = []
    for name, branch in zip(("P(1,1)", "P(inf,1)"), branches):
        for point in branch.special:
            largest = max(abs(m) for m in point.multipliers)
            rpm = float(rad_s_to_rpm(point.parameter))
            rows.append((name, str(point.kind), f"{rpm:.6f}", f"{largest:.4g}"))
    figure = branch_diagram(
        branches,
        x_label=("speed", "rpm"),
        y_label=("follower angle", "rad"),
        x_scale=float(rad_s_to_rpm(1.0)),
    )
    file = save_figure(figure, folder / "branches.png")
    return Branches(tuple(rows), file, _CAPTION)
