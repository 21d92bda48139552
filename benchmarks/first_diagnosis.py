"""Measure how long the first and the second diagnosis of a rig take.

Two cases of a rig in `docs/rigs` are drawn as in `benchmarks.own_rigs` and diagnosed,
each in a process of its own: the first with an empty folder for compiled programs, the
second with the folder that the first process filled. The script prints the CPU time of
`diagnose`, and how many programs were compiled instead of read from disk.

    python -m benchmarks.first_diagnosis two_stops
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter

from jax import monitoring

from benchmarks.own_rigs import case_of, RIGS
from jaxcam.discrepancy import diagnose
from jaxcam.fitting import read_setup


_COMPILING = "/jax/core/compile/backend_compile_duration"
_READING = "/jax/compilation_cache/cache_retrieval_time_sec"


def measured(rig: str, seed: int) -> dict:
    """The verdict of a case, the CPU time, and the number of compiled programs."""
    setup = read_setup(RIGS / f"{rig}.toml")
    _, recordings = case_of(rig, setup, seed)
    number = Counter()

    def listen(event: str, seconds: float, **_) -> None:
        del seconds
        number[event] += 1

    monitoring.register_event_duration_secs_listener(listen)
    begun = time.process_time()
    found = diagnose(setup, recordings, case=f"{rig} {seed}")
    return {
        "verdict": str(found.verdict),
        "seconds": time.process_time() - begun,
        "compiled": number[_COMPILING] - number[_READING],
    }


def in_process(rig: str, seed: int, folder: str) -> dict:
    """The same in a process of its own, which keeps its programs in a folder."""
    more = {
        "JAX_COMPILATION_CACHE_DIR": folder,
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }
    command = [sys.executable, "-m", "benchmarks.first_diagnosis", rig]
    command += ["--seed", str(seed)]
    done = subprocess.run(
        command, env=os.environ | more, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rig", nargs="?", default="two_stops")
    parser.add_argument("--seed", type=int, help="measure this case here")
    args = parser.parse_args()
    if args.seed is not None:
        print(json.dumps(measured(args.rig, args.seed)))
        return
    with tempfile.TemporaryDirectory() as folder:
        for name, seed in (("first", 1), ("second", 3)):
            found = in_process(args.rig, seed, folder)
            print(
                f"{args.rig}, {name} case: {found['seconds']:.0f} s of CPU, "
                f"{found['compiled']} programs compiled; verdict {found['verdict']}",
                flush=True,
            )


if __name__ == "__main__":
    main()
