"""Systems and solvers that the command line offers by name."""

import difflib
from collections.abc import Iterable
from typing import NamedTuple


class Ready(NamedTuple):
    """A named system and its default start."""

    model: str
    state: tuple[float, ...] | None
    """Default initial state; None for the release point."""
    turns: float | None
    """Default number of forcing periods; None for a duration in seconds."""
    duration: float
    """Default duration (s), if `turns` is None."""


SYSTEMS = {
    "cam-follower": Ready("CamFollower", None, 10.0, 0.0),
    "impact-oscillator": Ready("ImpactOscillator", None, 10.0, 0.0),
    "bouncing-ball": Ready("BouncingBall", (1.0, 0.0), None, 3.0),
    "triple-integrator": Ready("TripleIntegrator", (0.0, 0.1, -2.0), None, 3.0),
}
SOLVERS = {
    "dopri8": "Dopri8",
    "tsit5": "Tsit5",
    "dopri5": "Dopri5",
    "kvaerno5": "Kvaerno5",
}
ENGINES = ("loop", "diffeqsolve")
CAM = "cam-follower"
# number of names above which an error message shows only a few of them
_LISTED = 20


def choose(option: str, name: str, known: Iterable[str]) -> str:
    """Return a known name. **Raises:** `ValueError` with names to choose from."""
    known = tuple(known)
    if name in known:
        return name
    some, words = known, "choose one of"
    if len(known) > _LISTED:
        some = difflib.get_close_matches(name, known, n=4, cutoff=0.3) or known[:4]
        words = f"choose one of the {len(known)} that --list shows, such as"
    raise ValueError(f"{option} is {name[:100]!r}; {words} {', '.join(some)}.")


def ready(name: str) -> Ready:
    """Return the default start of a system.

    A system that is not listed here starts from its release point and runs for ten
    forcing periods.
    """
    return SYSTEMS.get(name, Ready(name, None, 10.0, 0.0))


def make_solver(name: str):
    """Return a diffrax solver by its name. **Raises:** `ValueError` for other names."""
    import diffrax

    return getattr(diffrax, SOLVERS[choose("--solver", name, SOLVERS)])()
