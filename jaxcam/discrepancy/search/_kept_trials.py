"""Store the fits of a diagnosis, so that an interrupted one can be resumed."""

import dataclasses
import hashlib
import os
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...fitting import Problem
from ...fitting.engine import Point
from ..policy import Policy
from ..terms import terms_of


# exceptions raised by numpy for foreign or damaged files
_BROKEN = (
    OSError,
    ValueError,
    LookupError,
    EOFError,
    MemoryError,
    NotImplementedError,
    zipfile.BadZipFile,
    zlib.error,
)


class Ended(NamedTuple):
    """The end of a fit: the point, whether it is an optimum, and the number of
    iterations.
    """

    point: Point
    converged: bool
    iterations: int


class KeptTrials:
    """The results of the fits of each subset of terms, one small file per subset.

    A file is used only for the same recordings, parameters, rig and policy; an
    incomplete file or one from another problem is ignored.

    **Arguments:** the folder, which is created with the first file, the problem and the
    policy.
    """

    def __init__(self, folder: Path, problem: Problem, policy: Policy = Policy()):
        self.folder, self.mark = folder, _mark_of(problem, policy)

    def get(self, names: Iterable[str]) -> Ended | None:
        """Return the stored end of a fit, or `None` if there is none."""
        try:
            with (
                self._file(names).open("rb") as stream,
                np.load(stream, allow_pickle=False) as found,
            ):
                if str(found["mark"]) != self.mark:
                    return None
                point = Point(
                    jnp.asarray(found["values"]),
                    jnp.asarray(found["states"]),
                    jnp.asarray(found["discrete"]) if "discrete" in found else None,
                )
                converged, iterations = bool(found["converged"]), found["iterations"]
                iterations = int(iterations)
        except _BROKEN:
            return None
        return Ended(point, converged, iterations)

    def put(self, names: Iterable[str], ended: Ended) -> None:
        """Store the end of a fit; an interruption leaves no incomplete file."""
        self.folder.mkdir(parents=True, exist_ok=True)
        file = self._file(names)
        part = file.with_suffix(f".{os.getpid()}.part")
        arrays = {
            name: np.asarray(one)
            for name, one in ended.point._asdict().items()
            if one is not None
        }
        with part.open("wb") as stream:
            np.savez(
                stream,
                mark=np.array(self.mark),
                converged=np.array(ended.converged),
                iterations=np.array(ended.iterations),
                **arrays,  # pyright: ignore
            )
        os.replace(part, file)

    def _file(self, names: Iterable[str]) -> Path:
        return self.folder / f"{'+'.join(sorted(names)) or 'none'}.npz"


def _mark_of(problem: Problem, policy: Policy) -> str:
    """Return a hash of a problem and its policy."""
    # more time does not change the fit of a subset
    policy = dataclasses.replace(policy, minutes=Policy().minutes)
    found = hashlib.sha256(repr((problem.names, policy)).encode())
    found.update(np.asarray(problem.start.values).tobytes())
    # constants of terms, such as a reference speed that was fitted
    for leaf in jax.tree.leaves(terms_of(problem.model)):
        found.update(np.asarray(leaf, dtype=float).tobytes())
    for part in problem.segments:
        found.update(part.recording.name.encode())
        found.update(np.ascontiguousarray(part.recording.time).tobytes())
        found.update(np.ascontiguousarray(part.recording[part.channel]).tobytes())
    return found.hexdigest()
