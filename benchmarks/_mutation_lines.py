"""Record which lines of some modules pytest executes with the given arguments.

python -m benchmarks._mutation_lines lines.json FILE... -- PYTEST_ARGUMENT...
"""

import json
import sys
import threading
from pathlib import Path

import pytest


def main(report: str, *rest: str) -> int:
    split = rest.index("--")
    wanted = {str(Path(name).resolve()): name for name in rest[:split]}
    seen: dict[str, set[int]] = {name: set() for name in rest[:split]}

    def look(frame, event, _):
        lines = seen[wanted[frame.f_code.co_filename]]

        def line(frame, event, _):
            lines.add(frame.f_lineno)
            return line

        lines.add(frame.f_lineno)
        return line

    def trace(frame, event, argument):
        if frame.f_code.co_filename in wanted:
            return look(frame, event, argument)
        return None

    threading.settrace(trace)
    sys.settrace(trace)
    code = pytest.main(list(rest[split + 1 :]))
    sys.settrace(None)
    lines = {name: sorted(found) for name, found in seen.items()}
    Path(report).write_text(json.dumps(lines))
    return int(code)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
