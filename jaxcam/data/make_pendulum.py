"""Make `pendulum/*.csv.gz`: `python -m jaxcam.data.make_pendulum FOLDER`.

`FOLDER` contains `swing_large.csv.gz` and `swing_small.csv.gz`, two swings at 1 kHz
from the public recordings named in `pendulum/SOURCE.md`. Every tenth sample is kept.
The end of each swing, where the pendulum hangs at rest, is omitted.
"""

import gzip
import sys
from pathlib import Path

import numpy as np


# decimation factor, for 100 samples per second
EVERY = 10
# resolution of the encoder (rad): 40000 counts per turn
COUNT = 2 * np.pi / 40000


def thinned(file: Path) -> str:
    """Return the kept lines of a recording as text, with times from zero."""
    with gzip.open(file, "rt", encoding="utf-8") as stream:
        head, *lines = stream.read().splitlines()
    kept = [line.split(",") for line in lines[::EVERY]]
    angle = np.array([float(angle) for _, angle in kept])
    moving = np.flatnonzero(np.abs(angle - angle[-1]) > 2 * COUNT)[-1] + 1
    start = float(kept[0][0])
    rows = [f"{float(time) - start:.2f},{text}" for time, text in kept[:moving]]
    return "\n".join([head, *rows, ""])


def main(source: Path) -> None:
    """Write both swings next to their rig file."""
    folder = Path(__file__).parent / "pendulum"
    for name in ("swing_large", "swing_small"):
        file = folder / f"{name}.csv.gz"
        data = thinned(source / file.name).encode("utf-8")
        # no time stamp, so that the same data give the same file
        file.write_bytes(gzip.compress(data, mtime=0))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
