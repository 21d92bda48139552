"""Simulate random systems with impacts, and compare them with a scipy event loop.

    python -m benchmarks.attack --systems 1000
    python -m benchmarks.attack --seed 17

Systems have one to three coordinates and one to three gaps, with springs, damping,
gyroscopic coupling, harmonic forces and short force pulses, moving walls, oblique
normals, restitution that falls with speed, sticking and release, in length units of
1e-6 to 1e6 m and time units of 1e-3 to 1e3 s, starting at times of up to 1e4 s. Every
system that disagrees is printed with its seed, followed by a table. The exit code is 1
if a system disagrees, or is rejected for a reason that is not in docs/limits.md.
"""

import argparse
import collections
import sys
import time

from ._attack_systems import draw, Problem, SHAPES
from ._attack_verdict import judge, know, plain, Verdict


# verdicts that indicate a defect
WRONG = ("DISAGREES", "MISBLAMES")


def attack(problem: Problem, sampled: bool = True) -> Verdict:
    """The verdict on a problem; for a disagreement, also whether it occurs only in
    these units.
    """
    known = know(problem)
    verdict = judge(problem, known, sampled=sampled)
    if verdict.label != "DISAGREES" or problem.length == problem.time == 1.0:
        return verdict
    again = judge(plain(problem), known, sampled=sampled)
    cause = "any units" if again.label == "DISAGREES" else "these units only"
    return verdict._replace(what=f"{cause}; {verdict.what}")


def describe(problem: Problem) -> str:
    """The units of a problem, in a few words."""
    units = f"{problem.length:.0e} m, {problem.time:.0e} s, from {problem.begin:g} s"
    kicked = f", kick of width {problem.kick_width:.2g}" if problem.kicked else ""
    return f"d = {problem.mass.size}, m = {problem.offset.size}, {units}{kicked}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--systems", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--seed", type=int, help="run only this seed")
    parser.add_argument("--shapes", nargs="+", type=int, help="run only these shapes")
    parser.add_argument("--plain", action="store_true", help="use unit scales")
    options = parser.parse_args()
    seeds = (
        [options.seed]
        if options.seed is not None
        else range(options.first, options.first + options.systems)
    )
    if options.shapes:
        seeds = [s for s in seeds if s % len(SHAPES) in options.shapes]
    counts, compared, begin = collections.Counter(), 0.0, time.monotonic()
    for number, seed in enumerate(seeds, start=1):
        problem = draw(seed)
        if options.plain:
            problem = problem.in_plain_units()
        try:
            verdict = attack(problem)
        except Exception as error:
            error.add_note(f"the event loop of seed {seed}")
            raise
        compared += verdict.compared
        refused = verdict.label in ("refuses", "MISBLAMES")
        counts[verdict.label, verdict.what.partition(":")[0] if refused else ""] += 1
        if verdict.label != "agrees" or options.seed is not None:
            said = f"seed {seed} {verdict.label}: {verdict.what} ({describe(problem)})"
            print(said, flush=True)
        if number % 20 == 0:
            spent = time.monotonic() - begin
            print(f"{number} systems, {spent:.0f} s, {dict(counts)}", flush=True)
    for (label, sentence), count in sorted(counts.items()):
        print(f"{count:6d}  {label} {sentence}")
    print(f"compared: {compared / max(len(seeds), 1):.2f} of the spans")
    return int(any(label in WRONG for label, _ in counts))


if __name__ == "__main__":
    sys.exit(main())
