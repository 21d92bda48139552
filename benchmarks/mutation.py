"""Check whether the tests of the event loop detect a changed line.

    python -m benchmarks.mutation --mutants 300 --workers 2 --report mutants.jsonl
    python -m benchmarks.mutation --again mutants.jsonl --tests tests/test_motion_*.py

Requires `pip install cosmic-ray`, and tests the committed code: each worker changes a
copy of HEAD in a temporary folder. All mutants of the modules below, in lines that the
tests run, are listed and shuffled. The tests are one pytest run that stops at the first
failure: first the parts of one step, then closed forms that need few programs, then
everything else, so that only survivors take the full time. Programs are compiled
without optimisation.

A survivor is printed as a diff, or reported as "no change" if jaxcam generates the same
programs from it; `--again` tries survivors with more tests. An existing report is
continued: mutants listed in it are not tried again.
"""

import argparse
import json
import multiprocessing
import os
import random
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path


MODULES = (
    "loop/_advance record/_assemble surface/_chatter loop/_flight loop/_functions "
    "loop/_gap_polynomial loop/_loop_state loop/_iterate surface/_normal "
    "surface/_rounding loop/_release loop/_run runge_kutta record/_sample loop/_select"
).split()
TESTS = [
    "tests/test_motion_parts.py",
    "tests/test_motion_rules.py",
    # one or two programs each, covering most kinds of motion
    "tests/test_motion_exact.py::test_launched_ball_bounces_and_rests",
    "tests/test_motion_exact.py::test_ball_leaves_the_table_where_it_falls_faster_than_free",
    "tests/test_more_degrees.py::test_two_masses",
    "tests/test_motion_chatter_map.py",
    "tests/test_motion_exact.py",
    "tests/test_more_degrees.py",
    # without the tests that take longest to compile
    "-k=not square and not LevelInTime and not steady and not diffeq and not two_stops",
]
# operators whose mutants are always detected say nothing about the tests
_SENSELESS = "FloorDiv Mod Pow LShift RShift BitXor Is IsNot".split()
_BITS = {"BitAnd", "BitOr"}
# to detect an endless loop: time limit (s) for one mutant, and as a multiple of the
# time that the tests take without a mutant
_PATIENCE, _TIMES = 60.0, 3.0
# tests of values do not require fast programs
_FLAGS = "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true"


def sensible(operator: str) -> bool:
    words = operator.rsplit("/", 1)[-1].split("_")[1:]
    return not set(words) & set(_SENSELESS) and len(_BITS & set(words)) != 1


def mutants(database: str) -> list:
    """All sensible changes of the modules, in a fixed order."""
    from cosmic_ray.commands import init
    from cosmic_ray.work_db import use_db

    paths = [Path(f"jaxcam/hybrid/{name}.py") for name in MODULES]
    with use_db(database) as db:
        init(paths, db, {})
        found = [m for item in db.work_items for m in item.mutations]
    found = [m for m in found if sensible(m.operator_name)]
    return sorted(
        found, key=lambda m: (str(m.module_path), m.operator_name, m.occurrence)
    )


class Copy:
    """A copy of HEAD in its own folder, with its own compiled programs."""

    def __init__(self, folder: str):
        self.folder = Path(folder)
        archive = subprocess.run(["git", "archive", "HEAD"], capture_output=True)
        subprocess.run(["tar", "x", "-C", folder], input=archive.stdout, check=True)
        os.chdir(folder)
        os.environ.update(
            PYTHONPATH=os.pathsep.join([folder, os.environ.get("PYTHONPATH", "")]),
            XDG_CACHE_HOME=str(self.folder / "cache"),
            XLA_FLAGS=_FLAGS,
            MPLBACKEND="Agg",
        )
        self.programs: set[Path] = set()

    def keep_programs(self) -> None:
        """Keep the programs compiled so far for every mutant."""
        self.programs = set((self.folder / "cache").rglob("*"))

    def drop_programs(self) -> None:
        for file in (self.folder / "cache").rglob("*"):
            if file not in self.programs and file.is_file():
                file.unlink()


def _command(tests) -> str:
    pytest = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow"]
    return shlex.join([*pytest, "-p", "no:cacheprovider", *tests])


def _digest() -> str:
    line = [sys.executable, "-m", "benchmarks._mutation_programs"]
    return subprocess.run(line, capture_output=True, text=True).stdout


def work(tests, drawn, tasks, results) -> None:
    """Try mutants by number until a `None` arrives."""
    from cosmic_ray.mutating import mutate_and_test, use_mutation
    from cosmic_ray.plugins import get_operator

    with tempfile.TemporaryDirectory() as folder:
        copy, line = Copy(folder), _command(tests)
        begin = time.monotonic()
        subprocess.run(shlex.split(line), check=True, stdout=subprocess.DEVNULL)
        whole, unchanged = time.monotonic() - begin, _digest()
        copy.keep_programs()
        results.put(("ready", whole, "", ""))
        while (number := tasks.get()) is not None:
            one, start = drawn[number], time.monotonic()
            result = mutate_and_test([one], line, _PATIENCE + _TIMES * whole)
            outcome = "killed"
            if not result.is_killed:
                operator = get_operator(one.operator_name)(**dict(one.operator_args))
                with use_mutation(one.module_path, operator, one.occurrence):
                    outcome = "no change" if _digest() == unchanged else "SURVIVED"
            copy.drop_programs()
            spent = time.monotonic() - start
            results.put((outcome, spent, number, result.diff or ""))
        os.chdir("/")


def lines_run(tests) -> dict:
    """Line numbers of each module that the tests run."""
    files = [f"jaxcam/hybrid/{name}.py" for name in MODULES]
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(folder)
        line = [sys.executable, "-m", "benchmarks._mutation_lines", "lines.json"]
        quiet = ["-x", "-q", "-m", "not slow", "-p", "no:cacheprovider"]
        subprocess.run(
            [*line, *files, "--", *quiet, *tests], check=True, stdout=subprocess.DEVNULL
        )
        lines = json.loads((copy.folder / "lines.json").read_text())
        os.chdir("/")
    return {name: set(numbers) for name, numbers in lines.items()}


def _listed(tests, report: Path | None) -> list:
    """The mutants in lines that the tests run; the line numbers are stored next to the
    report.
    """
    here = Path.cwd()
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    kept = report and report.with_suffix(f".{commit[:12]}.lines.json")
    if kept and kept.exists():
        lines = {name: set(v) for name, v in json.loads(kept.read_text()).items()}
    else:
        lines = lines_run(tests)
        os.chdir(here)
        if kept:
            text = json.dumps({name: sorted(v) for name, v in lines.items()})
            kept.write_text(text)
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree("jaxcam/hybrid", Path(folder) / "jaxcam/hybrid")
        os.chdir(folder)
        found = mutants("mutants.sqlite")
        os.chdir(here)
    run = [m for m in found if m.start_pos[0] in lines[str(m.module_path)]]
    print(f"{len(found)} mutants, {len(run)} in lines that the tests run", flush=True)
    return run


def _name(mutant) -> dict:
    operator = mutant.operator_name.rsplit("/", 1)[-1]
    place = f"{mutant.module_path}:{mutant.start_pos[0]}"
    return {"place": place, "operator": operator, "occurrence": mutant.occurrence}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mutants", type=int, default=300)
    parser.add_argument("--minutes", type=float, default=1e9, help="time limit")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--tests", nargs="+", default=TESTS, help="tests to run")
    parser.add_argument(
        "--report", type=Path, help="file for the outcomes, one per line"
    )
    parser.add_argument(
        "--again", type=Path, help="report whose survivors are tried again"
    )
    options = parser.parse_args()
    drawn = _listed(options.tests, options.report)
    random.Random(options.seed).shuffle(drawn)
    numbers = list(range(min(options.mutants, len(drawn))))
    source = options.again or options.report
    rows = []
    if source and source.exists():
        rows = [json.loads(text) for text in source.read_text().splitlines()]
    outcomes = {json.dumps(row["mutant"]): row["outcome"] for row in rows}
    known = [outcomes.get(json.dumps(_name(drawn[n]))) for n in numbers]
    wanted = "SURVIVED" if options.again else None
    todo = [n for n, outcome in zip(numbers, known, strict=True) if outcome == wanted]
    context = multiprocessing.get_context("spawn")
    tasks, results = context.Queue(), context.Queue()
    arguments = options.tests, drawn, tasks, results
    workers = [
        context.Process(target=work, args=arguments) for _ in range(options.workers)
    ]
    for worker in workers:
        worker.start()
    end, counts = time.monotonic() + 60 * options.minutes, {}
    # one at a time, so that nothing is left in the queue when the time is up
    waiting, at_work = iter(todo), len(workers)
    while at_work:
        outcome, spent, number, difference = results.get()
        if outcome == "ready":
            print(f"the tests take {spent:.0f} s without a mutant", flush=True)
        else:
            counts[outcome] = counts.get(outcome, 0) + 1
            name = _name(drawn[number])
            words = f"{outcome} {name['place']} {name['operator']} {spent:.0f} s"
            print(words, flush=True)
            if outcome != "killed":
                print(difference, flush=True)
            if options.report:
                row = {"mutant": name, "outcome": outcome, "seconds": round(spent, 1)}
                with options.report.open("a") as file:
                    file.write(json.dumps(row) + "\n")
        following = next(waiting, None) if time.monotonic() < end else None
        tasks.put(following)
        at_work -= following is None
    for worker in workers:
        worker.join()
    print(", ".join(f"{count} {outcome}" for outcome, count in sorted(counts.items())))


if __name__ == "__main__":
    main()
