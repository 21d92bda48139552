"""Run one measurement of a benchmark in a process of its own."""

import json
import os
import subprocess
import sys


def in_own_process(module: str, arguments: list[str], folder: str) -> tuple:
    """The numbers that `python -m benchmarks.MODULE --one ARGUMENTS` prints as JSON.

    The process keeps its compiled programs in a folder.
    """
    more = {
        "JAX_COMPILATION_CACHE_DIR": folder,
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }
    command = [sys.executable, "-m", f"benchmarks.{module}", "--one", *arguments]
    done = subprocess.run(
        command, env=os.environ | more, capture_output=True, text=True, check=True
    )
    return tuple(json.loads(done.stdout.splitlines()[-1]))
