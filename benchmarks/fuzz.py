"""Test jaxcam with malformed files and command lines for a given time.

    python -m benchmarks.fuzz --minutes 20
    python -m benchmarks.fuzz --minutes 2 --only tables --seed 7

The inputs and the definition of a defect are those of tests/test_hardening_*.py, which
try only a few. Each defect is printed with the smallest input that reproduces it; the
exit code is the number of properties that failed.
"""

import argparse
import collections
import os
import sys
import tempfile
import time
import traceback
from pathlib import Path


sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import hostile_commands
import hostile_files
from hypothesis import given, HealthCheck, Phase, seed, settings, strategies as st


# number of examples of one property before moving on to the next
_BATCH = 200


def properties(folder: Path, counts: collections.Counter):
    """The properties by name, as tests that hypothesis can run."""
    gaps = st.sampled_from(["refuse", "split", "mend"])

    def tables(file, gaps):
        counts["tables", hostile_files.read_table_or_say(folder, *file, gaps)] += 1

    def matlab(file, gaps):
        counts["matlab", hostile_files.read_table_or_say(folder, *file, gaps)] += 1

    def rigs(raw):
        counts["rigs", hostile_files.read_rig_or_say(folder, raw)] += 1

    def systems(raw):
        counts["systems", hostile_files.load_system_or_say(folder, raw)] += 1

    def commands(line):
        counts["commands", hostile_commands.run_or_say(folder, line)] += 1

    return {
        "tables": given(file=hostile_files.tables(), gaps=gaps)(tables),
        "matlab": given(file=hostile_files.matlab_files(), gaps=gaps)(matlab),
        "rigs": given(raw=hostile_files.rigs())(rigs),
        "systems": given(raw=hostile_files.systems())(systems),
        "commands": given(line=hostile_commands.lines())(commands),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--only", help="one property")
    parser.add_argument("--seed", type=int, default=time.time_ns() % 10**6)
    options = parser.parse_args()
    end = time.monotonic() + 60 * options.minutes
    counts, failed, number = collections.Counter(), set(), options.seed
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        names = [options.only] if options.only else [*properties(Path(), counts)]
        while time.monotonic() < end and len(failed) < len(names):
            for name in names:
                if name in failed or time.monotonic() > end:
                    continue
                test = properties(Path(folder), counts)[name]
                run = settings(
                    max_examples=_BATCH,
                    deadline=None,
                    database=None,
                    phases=[Phase.generate, Phase.shrink],
                    suppress_health_check=list(HealthCheck),
                )(seed(number)(test))
                try:
                    run()
                except Exception:
                    failed.add(name)
                    print(f"--- {name}, seed {number}", flush=True)
                    traceback.print_exc(file=sys.stdout)
            number += 1
    for (name, outcome), count in sorted(counts.items(), key=str):
        print(f"{name}: {count} {outcome}")
    return len(failed)


if __name__ == "__main__":
    sys.exit(main())
