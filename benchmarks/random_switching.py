"""Simulate random systems with switching surfaces, and compare them with exact motions.

    python -m benchmarks.random_switching --systems 10000
    python -m benchmarks.random_switching --seed 17

The systems are piecewise linear with harmonic forces: soft stops, backlash and
preloaded springs, relays with hysteresis and without, dry friction on the ground, on
belts and between two masses, with static friction and varying loads, impacts, and a
block in contact with a shaken plane. The reference computes their motion with matrix
exponentials and shares no code with jaxcam. The script compares the order and the times
of all events, the states at the events, and the final state; in addition, the friction
forces of sticking bodies must be within their limits, and the energy of systems without
a drive must not rise.
Every disagreement is printed with its seed, then a table. The exit code is 1 if a
system disagrees.
"""

import argparse
import collections
import sys
import time

import numpy as np

from jaxcam.hybrid import Settings

from ._switching_draw import draw, FAMILIES
from ._switching_verdict import judge, know, SETTINGS, Verdict


def verdict_of(seed: int, settings: Settings = SETTINGS) -> Verdict:
    """The verdict on the problem of a seed."""
    problem = draw(seed)
    return judge(problem, know(problem), settings)


def table(found: dict[str, list[Verdict]]) -> str:
    """The results of each family."""
    columns = (
        "systems agree graze ambiguous disagree events compared error allowed".split()
    )
    lines = [f"{'family':22s}" + "".join(f"{c:>11s}" for c in columns)]
    whole = [v for each in found.values() for v in each]
    for family, verdicts in [*found.items(), ("all", whole)]:
        labels = collections.Counter(v.label for v in verdicts)
        right = [v for v in verdicts if v.label != "DISAGREES"]
        kinds = "agrees", "grazes", "ambiguous", "DISAGREES"
        numbers = len(verdicts), *(labels[kind] for kind in kinds)
        lines.append(
            f"{family:22s}"
            + "".join(f"{n:11d}" for n in (*numbers, sum(v.events for v in verdicts)))
            + f"{np.mean([v.compared for v in verdicts]):11.4f}"
            + f"{max((v.error for v in right), default=0.0):11.1e}"
            + f"{max((v.worst for v in right), default=0.0):11.3f}"
        )
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--systems", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--seed", type=int, help="run only this seed")
    parser.add_argument("--tolerance", type=float, default=1e-12)
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.systems)
    if options.seed is not None:
        seeds = [options.seed]
    settings = Settings(tolerance=options.tolerance)
    found: dict[str, list[Verdict]] = {}
    begin = time.monotonic()
    for number, seed in enumerate(seeds, start=1):
        family = FAMILIES[seed % len(FAMILIES)]
        try:
            verdict = verdict_of(seed, settings)
        except Exception as error:
            said = f"raised {type(error).__name__}: {error}".splitlines()[0]
            verdict = Verdict("DISAGREES", said, 0.0, 0, np.inf, np.inf)
        found.setdefault(family, []).append(verdict)
        if verdict.label == "DISAGREES" or options.seed is not None:
            said = f"seed {seed} ({family}) {verdict.label}: {verdict.what}"
            print(said, flush=True)
        if number % 500 == 0:
            print(f"{number} systems, {time.monotonic() - begin:.0f} s", flush=True)
    print(table(found))
    wrong = [v for each in found.values() for v in each if v.label == "DISAGREES"]
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
