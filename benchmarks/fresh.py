"""Count correct verdicts on random cases: is the hidden effect named, and nothing else?

Rigs are drawn from anywhere in the tolerance box, with six records of four seconds at
random speeds, made by a scalar loop (`_numba_rig`) that shares no code with the
diagnosis. Of twenty cases, three lack nothing, thirteen lack one term, and four lack
two. A strength is the unit of a term (roughly a typical defect) times one of `LEVELS`;
most effects are partly absorbed when the rig parameters are refitted. The script prints
one line per case and the fractions of correct verdicts, and stores each verdict in a
file of JSON lines, from which an interrupted run resumes.

    python -m benchmarks.fresh --cases 40 [--rig rig.toml]
"""

import argparse
import dataclasses
import math
import time
from pathlib import Path

import numpy as np

import jaxcam  # noqa: F401  64-bit floats
from jaxcam.data import DEMO_RIG
from jaxcam.discrepancy import diagnose, Diagnosis
from jaxcam.recordings import read_rig, Recording

from ._hidden_records import hidden_records
from ._numba_rig import Hidden
from ._verdicts import close, Kept
from .coverage import random_rig


DURATION = 4.0
SPANS_RPM = ((128, 140), (140, 148), (141, 149), (150, 158), (158, 173), (160, 178))
LEVELS = (0.1, 0.2, 0.3, 0.5, 1.0)
# name of the effect, its field in `Hidden`, and its unit
UNITS = {
    "viscous_damping": ("c1", 0.18),
    "coulomb_friction": ("fc", 0.3),
    "quadratic_drag": ("c2", 0.1),
    "nonlinear_spring": ("k3", 140.0),
    "restitution_velocity": ("rb", 0.055),
    "drive_ripple": ("eps", 6.4e-3),
    "cam_profile_error": ("run", 8.7e-4),
    "sensor_lag": ("lag", 5.7e-4),
    "external_vibration": ("ext", 0.26),
}


@dataclasses.dataclass(frozen=True)
class Case:
    """The names and strengths of the hidden effects, and the recordings."""

    names: tuple[str, ...]
    level: float
    hidden: Hidden
    records: tuple[Recording, ...]


def draw(nominal, number: int) -> Case:
    """A case, determined by its number."""
    rng = np.random.default_rng([2026, number])
    many = rng.choice([0, 1, 2], p=[0.15, 0.65, 0.2])
    names = tuple(str(name) for name in rng.choice(list(UNITS), many, replace=False))
    level = float(rng.choice(LEVELS))
    hidden = Hidden(psi=rng.uniform(0.0, 2 * math.pi), fe=rng.uniform(8.0, 40.0))
    for name in names:
        field, unit = UNITS[name]
        size = level * unit * rng.uniform(0.8, 1.25)
        hidden = dataclasses.replace(hidden, **{field: size})
    real = dataclasses.replace(random_rig(nominal, rng), damping=0.0)
    records = hidden_records(real, hidden, nominal.sensors, SPANS_RPM, DURATION, rng)
    return Case(names, level, hidden, records)


def judged(nominal, number: int) -> dict:
    """The verdict on one case, with the truth."""
    case = draw(nominal, number)
    begun, cpu = time.time(), time.process_time()
    found = diagnose(nominal, case.records)
    return {
        "number": number,
        "truth": sorted(case.names),
        "level": case.level,
        "verdict": found.verdict,
        "names": sorted(set(found.names) - {"unknown"}),
        "sizes": _sizes(case, found),
        "before": found.heldout_before / found.noise_floor,
        "after": found.heldout_after / found.noise_floor,
        "wall": time.time() - begun,
        "cpu": time.process_time() - cpu,
    }


def _sizes(case: Case, found: Diagnosis) -> dict:
    """True strength, estimated strength and its error for each correctly named term."""
    sizes = {}
    for effect in found.effects:
        if effect.name in case.names:
            field = UNITS[effect.name][0]
            one = effect.parameters[field]
            sizes[effect.name] = getattr(case.hidden, field), one.value, one.stderr
    return sizes


def right(one: dict) -> bool:
    verdict = "effect" if one["truth"] else "none"
    return one["verdict"] == verdict and one["names"] == one["truth"]


def report(cases: list[dict]) -> None:
    kinds = {0: "nothing", 1: "one term", 2: "two terms"}
    print(
        "| truth | cases | right | strengths | unseen after (worst) | CPU s (worst) |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    for many, words in kinds.items():
        here = [one for one in cases if len(one["truth"]) == many]
        if not here:
            continue
        sizes = [size for one in here for size in one["sizes"].values()]
        print(
            f"| {words} | {len(here)} | {sum(map(right, here))} | "
            f"{sum(close(*size) for size in sizes)}/{len(sizes)} | "
            f"{max(one['after'] for one in here):.3f} | "
            f"{max(one['cpu'] for one in here):.0f} |"
        )
    for one in cases:
        if not right(one):
            print(
                f"case {one['number']}: {' '.join(one['truth']) or 'nothing'} at level "
                f"{one['level']:g}: {one['verdict']} {' '.join(one['names'])}, "
                f"held-out {one['before']:.3f} -> {one['after']:.3f}"
            )


def _said(one: dict) -> str:
    truth = " ".join(one["truth"]) or "nothing"
    return (
        f"{one['number']}: {truth} x {one['level']:g}: {one['verdict']} "
        f"{' '.join(one['names'])} ({one['wall']:.0f} s, {one['cpu']:.0f} s of CPU)"
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="number of first case")
    parser.add_argument("--rig", type=Path, default=DEMO_RIG / "rig.toml")
    parser.add_argument("--file", type=Path, default=Path("fresh.jsonl"))
    options = parser.parse_args()
    nominal = read_rig(options.rig)
    kept = Kept(options.file, lambda one: one["number"])
    numbers = range(options.first, options.first + options.cases)
    report([kept.get(k, lambda k=k: judged(nominal, k), _said) for k in numbers])


if __name__ == "__main__":
    main()
