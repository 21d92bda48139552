"""Measure how often an effect is named, as a function of its strength, and how often
falsely.

Rigs are drawn at random from the tolerance box, with one effect or none and three
records of two seconds at random speeds, made by a scalar loop (`_numba_rig`) that
shares no code with the diagnosis. Strengths are multiples of the detection limit
reported by a diagnosis of similar records. The script prints a table and stores each
verdict in a file of JSON lines, from which an interrupted run resumes.

    python -m benchmarks.power --nulls 200 --first 200
    python -m benchmarks.power --effects --draws 10
    python -m benchmarks.power --unlisted --draws 10
"""

import argparse
import dataclasses
import time
from pathlib import Path

import numpy as np

import jaxcam  # noqa: F401  64-bit floats
from jaxcam.data import DEMO_RIG
from jaxcam.discrepancy import diagnose
from jaxcam.recordings import read_rig, Recording

from ._hidden_records import hidden_records
from ._numba_rig import Hidden
from ._verdicts import close, Kept
from .coverage import random_rig


DURATION = 2.0
SPANS_RPM = ((128.0, 145.0), (146.0, 158.0), (159.0, 175.0))
LEVELS = (0.5, 1.0, 2.0, 4.0)
# name of the effect, its field in `Hidden`, and a unit if no limit is reported
EFFECTS = {
    "viscous_damping": ("c1", None),
    "coulomb_friction": ("fc", None),
    "quadratic_drag": ("c2", None),
    "nonlinear_spring": ("k3", None),
    "restitution_velocity": ("rb", None),
    "cam_profile_error": ("run", None),
    "sensor_lag": ("lag", None),
    "external_vibration": ("ext", 0.03),
    "drive_ripple": ("eps", 1e-5),
}
# unnamed effects, and strengths at which they matter
UNLISTED = {"imbalance": 0.3, "fading": 0.005, "step": 0.1, "one_way": 0.1}


def case(nominal, hidden: Hidden, rng) -> tuple[Recording, ...]:
    """Three records of one rig."""
    real = dataclasses.replace(random_rig(nominal, rng), damping=0.0)
    if hidden.ext:
        hidden = dataclasses.replace(hidden, fe=rng.uniform(12.0, 40.0))
    return hidden_records(real, hidden, nominal.sensors, SPANS_RPM, DURATION, rng)


def judged(nominal, effect: str, strength: float, number: int) -> dict:
    """Verdict on one case, whose rig and noise are determined by its number."""
    rng = np.random.default_rng([number, sum(effect.encode())])
    field = EFFECTS[effect][0] if effect in EFFECTS else effect
    hidden = Hidden() if effect == "none" else Hidden(**{field: strength})
    begun = time.process_time()
    found = diagnose(nominal, case(nominal, hidden, rng))
    sizes = [e.parameters[field] for e in found.effects if field in e.parameters]
    return {
        "effect": effect,
        "strength": strength,
        "number": number,
        "verdict": found.verdict,
        "names": sorted(found.names),
        "where": sorted({e.where for e in found.effects}),
        "size": [(one.value, one.stderr) for one in sizes],
        "after": found.heldout_after / found.noise_floor,
        "limits": {name: one.value for name, one in found.limits.items()},
        "seconds": time.process_time() - begun,
    }


class Verdicts:
    """Verdicts by effect, strength and case number."""

    def __init__(self, file: Path):
        self._nominal = read_rig(DEMO_RIG / "rig.toml")
        self._kept = Kept(file, _key)

    def get(self, effect: str, strength: float, number: int) -> dict:
        key = effect, float(f"{strength:.6g}"), number
        return self._kept.get(key, lambda: judged(self._nominal, *key), _said)


def _key(one: dict) -> tuple[str, float, int]:
    return one["effect"], one["strength"], one["number"]


def _said(one: dict) -> str:
    words = " ".join(one["names"]) or one["verdict"]
    return f"{_key(one)}: {words}, {one['seconds']:.0f} s"


def nulls(verdicts: Verdicts, count: int, first: int) -> None:
    numbers = range(first, first + count)
    cases = [verdicts.get("none", 0.0, number) for number in numbers]
    wrong = [one for one in cases if one["verdict"] != "none"]
    print(f"without hidden physics: {len(wrong)} of {count} are not `none`")
    for one in wrong:
        print(f"  case {one['number']}: {one['verdict']} {' '.join(one['names'])}")


def powers(verdicts: Verdicts, draws: int, names) -> None:
    limits = [verdicts.get("none", 0.0, number)["limits"] for number in range(3)]
    print("| effect | unit | " + " | ".join(f"x {x:g}" for x in LEVELS) + " | size |")
    print("| --- | --- |" + " --- |" * (len(LEVELS) + 1))
    for effect in names:
        field, unit = EFFECTS[effect]
        unit = unit or float(np.median([one[field] for one in limits]))
        cells = []
        for level in LEVELS:
            cases = [verdicts.get(effect, level * unit, k) for k in range(draws)]
            right = [one["names"] == [effect] for one in cases]
            cells.append(f"{sum(right)}/{draws}")
            if level == LEVELS[-1]:
                found = [one["size"][0] for one in cases if one["size"]]
                good = [close(level * unit, *one) for one in found]
                cells.append(f"{sum(good)}/{len(found)}")
        print(f"| {effect} | {unit:.3g} | " + " | ".join(cells) + " |", flush=True)


def unlisted(verdicts: Verdicts, draws: int) -> None:
    print("| not in the list | strength | unknown | where | none | named |")
    print("| --- | --- | --- | --- | --- | --- |")
    for effect, size in UNLISTED.items():
        for level in (1.0, 3.0):
            cases = [verdicts.get(effect, level * size, k) for k in range(draws)]
            kinds = [one["verdict"] for one in cases]
            where = sorted({w for one in cases for w in one["where"]})
            named = sorted({n for one in cases for n in one["names"]} - {"unknown"})
            print(
                f"| {effect} | {level * size:.3g} | {kinds.count('unknown')}/{draws} | "
                f"{' '.join(where)} | {kinds.count('none')} | "
                f"{kinds.count('effect')} {' '.join(named)} |",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--nulls", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first null")
    parser.add_argument("--effects", nargs="*", choices=EFFECTS)
    parser.add_argument("--unlisted", action="store_true")
    parser.add_argument("--draws", type=int, default=10)
    parser.add_argument("--file", type=Path, default=Path("power.jsonl"))
    options = parser.parse_args()
    verdicts = Verdicts(options.file)
    if options.nulls:
        nulls(verdicts, options.nulls, options.first)
    if options.effects is not None:
        powers(verdicts, options.draws, options.effects or list(EFFECTS))
    if options.unlisted:
        unlisted(verdicts, options.draws)


if __name__ == "__main__":
    main()
