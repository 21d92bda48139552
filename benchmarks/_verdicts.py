"""Whether a number is right, and verdicts that survive an interrupted run."""

import json
import sys
from collections.abc import Callable
from pathlib import Path


def close(true: float, value: float, stderr: float) -> bool:
    """Whether a value is within 15 per cent or two standard errors of the true one."""
    return abs(value - true) < max(0.15 * true, 2 * stderr)


class Kept:
    """Verdicts in a file of JSON lines; `key` returns the case of a verdict."""

    def __init__(self, file: Path, key: Callable):
        self._file, self._key = file, key
        lines = file.read_text().splitlines() if file.exists() else []
        self._known = {key(one): one for one in map(json.loads, lines)}

    def get(self, case, judge: Callable, said: Callable[[dict], str]) -> dict:
        """The verdict on a case, from the file or from `judge()`; it is printed."""
        if case not in self._known:
            one = judge()
            self._known[self._key(one)] = one
            with self._file.open("a") as stream:
                stream.write(json.dumps(one) + "\n")
            print(said(one), file=sys.stderr, flush=True)
        return self._known[case]
