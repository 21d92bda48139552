"""Diagnose cases with unknown keys, and collect the verdicts in one file.

A case is a folder with `rig.txt`, which contains one word, and one CSV file per record;
the word names a file in `docs/rigs` or, for a cam-follower, in the `--rigs` folder.
Every verdict is stored immediately, so several of these commands may share the work,
and an interrupted one can be resumed. The last one writes the file.

    python -m benchmarks.sealed_verdicts CASES --rigs RIGS --keep KEPT --out set2.json
"""

import argparse
import json
import time
import traceback
from pathlib import Path

from benchmarks.own_rigs import RIGS
from jaxcam.discrepancy import diagnose
from jaxcam.fitting import read_setup
from jaxcam.recordings import read_case, read_rig


def verdict_of(case: Path, rigs: Path) -> dict:
    """The verdict on a case, and the seconds it took."""
    name, begun = (case / "rig.txt").read_text().strip(), time.time()
    if name == "cam_follower":
        rig = read_rig(rigs / f"{name}.toml")
        runs = read_case(case)
    else:
        rig = read_setup(RIGS / f"{name}.toml")
        runs = rig.read_case(case)
    found = diagnose(rig, tuple(runs), case=case.name)
    return {**found.to_json(), "seconds": round(time.time() - begun)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", type=Path)
    parser.add_argument("--rigs", type=Path, required=True)
    parser.add_argument("--keep", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    args.keep.mkdir(parents=True, exist_ok=True)
    cases = sorted(path.parent for path in args.cases.glob("*/rig.txt"))
    for case in cases:
        file = args.keep / f"{case.name}.json"
        try:
            # another command may be working on it
            (args.keep / f"{case.name}.begun").touch(exist_ok=False)
        except FileExistsError:
            continue
        try:
            verdict = verdict_of(case, args.rigs)
        except Exception as error:
            traceback.print_exc()
            verdict = {"case": case.name, "verdict": "failed", "summary": str(error)}
        file.write_text(json.dumps(verdict, default=float))
        print(f"{case.name}: {verdict['verdict']}: {verdict['summary']}", flush=True)
    files = [args.keep / f"{case.name}.json" for case in cases]
    if all(file.is_file() for file in files):
        every = [json.loads(file.read_text()) for file in files]
        args.out.write_text(json.dumps(every, indent=1) + "\n")


if __name__ == "__main__":
    main()
