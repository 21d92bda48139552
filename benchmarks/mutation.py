"""Do the tests of the event loop notice when a line of it is changed?

    python benchmarks/mutation.py --minutes 40 --seed 1 --report survivors.jsonl
    python benchmarks/mutation.py --again survivors.jsonl --tests tests/test_motion_*.py

Needs `pip install cosmic-ray`, and tries what is committed: it works on a copy of HEAD
in a temporary folder. All mutants of the modules below are listed and shuffled, and as
many are tried as fit into the time. Each is compiled anew, so the tests are few and the
quick ones come first. What survives is printed as a difference; `--again` tries it with
more tests. A minute or two of one core each.
"""

import argparse
import json
import os
import random
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import attrs
from cosmic_ray.commands import init
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.work_db import use_db
from cosmic_ray.work_item import MutationSpec


MODULES = (
    "advance assemble chatter flight functions gap_polynomial lane loop normal release "
    "run runge_kutta sample select"
).split()
TESTS = [
    "tests/test_motion_parts.py",
    "tests/test_motion_exact.py",
    "tests/test_motion_chatter_map.py",
    "tests/test_more_degrees.py",
    # what takes longest to compile
    "-k=not square and not LevelInTime and not steady and not diffeq and not two_stops",
]
# operators that no line of the loop survives say nothing of its tests
_SENSELESS = "FloorDiv Mod Pow LShift RShift BitXor Is IsNot".split()
_BITS = {"BitAnd", "BitOr"}
# seconds for one mutant; a loop that does not end is noticed
_PATIENCE = 400


def sensible(operator: str) -> bool:
    words = operator.rsplit("/", 1)[-1].split("_")[1:]
    return not set(words) & set(_SENSELESS) and len(_BITS & set(words)) != 1


def mutants(database: str) -> list[MutationSpec]:
    paths = [Path(f"jaxcam/hybrid/_{name}.py") for name in MODULES]
    with use_db(database) as db:
        init(paths, db, {})
        found = [m for item in db.work_items for m in item.mutations]
    found = [m for m in found if sensible(m.operator_name)]
    return sorted(found, key=lambda m: (m.module_path, m.operator_name, m.occurrence))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=40.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tests", nargs="+", default=TESTS, help="or other tests")
    parser.add_argument("--report", type=Path, help="survivors, one a line")
    parser.add_argument("--again", type=Path, help="a report: try its survivors")
    options = parser.parse_args()
    report = options.report and options.report.resolve()
    again = options.again and options.again.read_text().splitlines()
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(["git", "archive", "HEAD"], capture_output=True)
        subprocess.run(["tar", "x", "-C", folder], input=archive.stdout, check=True)
        os.chdir(folder)
        os.environ["PYTHONPATH"] = folder
        pytest = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow"]
        line = shlex.join([*pytest, "-p", "no:cacheprovider", *options.tests])
        if again:
            drawn = [MutationSpec(**json.loads(text)) for text in again]
        else:
            drawn = mutants("mutants.sqlite")
            random.Random(options.seed).shuffle(drawn)
        begin = time.monotonic()
        subprocess.run(shlex.split(line), check=True, stdout=subprocess.DEVNULL)
        print(f"{len(drawn)} mutants; without one {time.monotonic() - begin:.0f} s")
        begin, tried, survived = time.monotonic(), 0, 0
        for one in drawn:
            if time.monotonic() - begin > 60 * options.minutes:
                break
            start = time.monotonic()
            result = mutate_and_test([one], line, _PATIENCE)
            tried, survived = tried + 1, survived + (not result.is_killed)
            spent = time.monotonic() - start
            outcome = "killed" if result.is_killed else "SURVIVED"
            place = f"{one.module_path}:{one.start_pos[0]}"
            print(f"{outcome} {place} {one.operator_name} {spent:.0f} s", flush=True)
            if not result.is_killed:
                print(result.diff, flush=True)
                if report:
                    text = json.dumps(attrs.asdict(one), default=str)
                    with report.open("a") as file:
                        file.write(text + "\n")
        print(f"{tried} tried, {survived} survived")


if __name__ == "__main__":
    main()
