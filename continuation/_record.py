"""Store branches on disk: one line of JSON for each point, written immediately.

Format, version 1: UTF-8 text with one JSON object per line. The first line is the
header, with `format` = "continuation branch", `version`, `parameter`, `parameters`,
`leaf`, `bounds`, and any entries added by the writer. Each further line is a point,
with the fields of `continuation.Point` except its problem. Numbers are written so that
they read back as the same 64-bit floats; non-finite numbers are strings; complex
numbers are pairs; `observed` arrays have their `shape` and `dtype`. An incomplete last
line is a point that was being written when the run was interrupted; it is ignored.
"""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ._parameter import as_arguments
from ._point import Branch, Point, set_parameters, with_parameter
from .problem import AbstractProblem


FORMAT = "continuation branch"
VERSION = 1


class Recorder:
    """A callback that appends points to a file as they are found.

    **Arguments:** `path`: the file; `header`: entries of its first line in addition to
    the format; `after`: points found earlier, which are written to the new file first.
    """

    def __init__(
        self, path: str | os.PathLike, header: dict, after: tuple[Point, ...] = ()
    ):
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        lines = [{"format": FORMAT, "version": VERSION, **header}]
        lines += [_point_to_json(point) for point in after]
        # the old file stays intact until the new one is complete
        fresh = self.path.with_name(self.path.name + ".new")
        fresh.write_text("".join(_line(x) for x in lines), "utf-8")
        os.replace(fresh, self.path)

    def __call__(self, point: Point) -> None:
        with self.path.open("a", encoding="utf-8") as file:
            file.write(_line(_point_to_json(point)))


def save_branch(branch: Branch, path: str | os.PathLike) -> None:
    """Write a branch to a file that [`continuation.load_branch`][] can read.

    Args:
        branch: The branch.
        path: The file to write.

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> found = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> continuation.save_branch(found, "branch.jsonl")
        >>> len(continuation.load_branch("branch.jsonl").points) == len(found.points)
        True
    """
    Recorder(path, header_of(branch), branch.points)


def header_of(branch: Branch, **more: Any) -> dict:
    """Return the entries of the first line of a file, without the format."""
    return {
        "parameter": branch.name,
        "parameters": list(branch.names),
        "leaf": branch.leaf,
        "bounds": list(branch.bounds),
        **more,
    }


def load_branch(
    path: str | os.PathLike, problem: AbstractProblem | None = None
) -> Branch:
    """Read a saved branch, or the part of it written by an interrupted run.

    Args:
        path: The file to read.
        problem: The problem of the branch. It is attached to each point, with the
            parameters of that point, so that other branches can be followed from a
            special point, and special points can be continued in two parameters.

    Returns:
        A [`continuation.Branch`][].

    Raises:
        ValueError: The file does not contain a branch, or has a later format version.

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> found = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> continuation.save_branch(found, "branch.jsonl")
        >>> continuation.load_branch("branch.jsonl", problem).special[0].kind
        'fold'
    """
    return read_branch(path, problem)[0]


def read_branch(
    path: str | os.PathLike, problem: AbstractProblem | None = None
) -> tuple[Branch, dict]:
    """Return a branch and the header of its file."""
    try:
        text = Path(path).read_text("utf-8")
        lines = text.split("\n")[:-1]
        header, *rest = [json.loads(line) for line in lines]
    except (ValueError, RecursionError):
        raise ValueError(
            f"{path} is not JSON; give a file written by save_branch"
        ) from None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise ValueError(
            f"{path} is not a saved branch; give a file written by save_branch"
        )
    if header.get("version") != VERSION:
        raise ValueError(
            f"{path} has version {header.get('version')} of the format, but this "
            f"program reads version {VERSION}; read it with the program that wrote it"
        )
    try:
        leaf = int(header["leaf"])
        attach = _attacher(problem, leaf)
        points = tuple(_point_from_json(line, attach) for line in rest)
        low, high = header["bounds"]
        names = tuple(header["parameters"])
        branch = Branch(points, header["parameter"], (low, high), leaf, names)
    except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError):
        raise ValueError(
            f"{path} is damaged; remove it, or the lines that were changed"
        ) from None
    return branch, header


def _attacher(problem: AbstractProblem | None, leaf: int) -> Callable:
    """Return a function that gives the problem for a signature and a parameter
    value.
    """
    if problem is None:
        return lambda signature, value: None
    stated: AbstractProblem = set_parameters(
        problem, as_arguments(problem.parameters, leaf)
    )
    known = {stated.signature: stated}

    def attach(signature: str, value: float) -> AbstractProblem:
        if signature not in known:
            known[signature] = stated.with_signature(signature)
        return with_parameter(known[signature], leaf, value)

    return attach


def _line(value: Any) -> str:
    return json.dumps(value, allow_nan=False, separators=(",", ":")) + "\n"


def _number(x: Any) -> Any:
    """Return a float as a JSON value, which is a string if the float is not finite."""
    x = float(x)
    return x if np.isfinite(x) else str(x)


def _array(x: Any) -> dict:
    x = np.asarray(x)
    if x.dtype == bool or np.issubdtype(x.dtype, np.integer):
        values = x.ravel().tolist()
    else:
        values = [_number(v) for v in x.ravel()]
    return {"shape": list(x.shape), "dtype": str(x.dtype), "values": values}


def _point_to_json(point: Point) -> dict:
    return {
        "label": point.label,
        "kind": point.kind,
        "parameter": _number(point.parameter),
        "parameters": [_number(x) for x in point.parameters],
        "state": [_number(x) for x in point.state],
        "multipliers": [[_number(x.real), _number(x.imag)] for x in point.multipliers],
        "stable": point.stable,
        "tangent": [_number(x) for x in point.tangent],
        "scale": [_number(x) for x in point.scale],
        "step": _number(point.step),
        "arclength": _number(point.arclength),
        "iterations": point.iterations,
        "converged": point.converged,
        "reason": point.reason,
        "coefficient": None if point.coefficient is None else float(point.coefficient),
        "criticality": point.criticality,
        "observed": {k: _array(v) for k, v in point.observed.items()},
        "tests": {k: _number(v) for k, v in point.tests.items()},
        "signature": point.signature,
    }


# fields of a point that are stored in JSON unchanged
_TAKEN_OVER: dict[str, Any] = {
    "label": int,
    "kind": str,
    "stable": bool | None,
    "iterations": int,
    "converged": bool,
    "reason": str,
    "coefficient": float | int | None,
    "criticality": str,
    "signature": str,
}


def _point_from_json(line: Any, attach: Callable) -> Point:
    def vector(x):
        return np.array([float(v) for v in x])

    value = dict(line)
    for name, kind in _TAKEN_OVER.items():
        if not isinstance(value[name], kind):
            raise TypeError(name)
    value["parameter"] = float(line["parameter"])
    value["parameters"] = tuple(float(x) for x in line["parameters"])
    for name in ("state", "tangent", "scale"):
        value[name] = vector(line[name])
    value["multipliers"] = np.array(
        [complex(float(re), float(im)) for re, im in line["multipliers"]], complex
    )
    value["step"], value["arclength"] = float(line["step"]), float(line["arclength"])
    value["observed"] = {
        k: np.array([float(x) if isinstance(x, str) else x for x in v["values"]])
        .astype(v["dtype"])
        .reshape(v["shape"])
        for k, v in line["observed"].items()
    }
    value["tests"] = {k: float(v) for k, v in line["tests"].items()}
    value["problem"] = attach(line["signature"], value["parameter"])
    return Point(**value)
