"""The numbers of a `SingleShooting` as text, which is saved with every point."""

from typing import Any

import numpy as np


def family_of(problem: Any) -> str:
    """Return the numbers on which the meaning of the unknowns depends."""
    shift = float(problem.shift)
    words = f" shift {shift!r}" if shift else ""
    if problem.held:
        words += " held " + ",".join(map(str, problem.held))
    return f"single shooting periods {problem.periods} turns {problem.turns}{words}"


def numbers_in(signature: str) -> dict[str, Any] | None:
    """Return the fields that a signature gives; None if it is of another problem."""
    words = signature.split()
    known = dict(zip(words[2::2], words[3::2], strict=False))
    if words[:2] != ["single", "shooting"] or not {"periods", "turns"} <= set(known):
        return None
    held = [int(k) for k in known.get("held", "").split(",") if k]
    return {
        "periods": int(known["periods"]),
        "turns": int(known["turns"]),
        "shift": np.asarray(float(known.get("shift", 0.0))),
        "passed": np.asarray(float(known.get("grazings", 0.0))),
        "held": tuple(held),
    }
