"""Figures 2.3, 2.4, 2.7, 2.11 and 2.13: maps, normal forms and the Zeno ball."""

from functools import cache
from typing import Any, NamedTuple, TYPE_CHECKING

import jax.numpy as jnp
import numpy as np

from ..hybrid import simulate, Trajectory
from ..maps import (
    border_collision,
    feigenbaum_ratios,
    iterate,
    LogisticMap,
    map_attractor,
    NORMAL_FORMS,
    SkewMap,
    SquareRootMap,
    superstable,
)
from ..models import BouncingBall, CamFollower
from ..timestepping import moreau, SteppedMotion
from ._frame import frame


if TYPE_CHECKING:
    import pandas as pd


def _numbers(*values):
    return [jnp.asarray(value, dtype=float) for value in values]


#: parameter and start of the three cobwebs
COBWEBS = ((1.5, 0.8), (3.3, 0.6), (3.8, 0.1))
#: the three maps of Figure 2.11, which gives no numbers
MAPS = {
    "piecewise-linear, continuous": SkewMap(*_numbers(0.5, -1.5, 0.3)),
    "piecewise-linear, discontinuous": SkewMap(*_numbers(0.5, 0.4, 0.3, -1.0)),
    "square root": SquareRootMap(*_numbers(0.5, 0.1)),
}
#: (2.17)
FEIGENBAUM = 4.669
_NAN = float("nan")
_BALL = BouncingBall(*_numbers(9.81, 0.7))
_LAUNCH = 1.0


def figure_2_3(system: CamFollower) -> "pd.DataFrame":
    """Figure 2.3: where the cobwebs of the logistic map end; formulas as printed."""
    del system
    rows: list[tuple[str, Any, Any, str]] = []
    one, two, chaos = (LogisticMap(mu) for mu, _ in COBWEBS)
    end = float(iterate(one, COBWEBS[0][1], 400)[-1])
    rows.append(("mu = 1.5: fixed point (mu - 1)/mu", one.fixed_point(), end, ""))
    ends = np.sort(np.asarray(iterate(two, COBWEBS[1][1], 1000)[-2:]))
    for k, name in enumerate(("lower", "upper")):
        formula = two.period_two()[k]
        rows.append((f"mu = 3.3: {name} point of period two", formula, ends[k], ""))
    found = map_attractor(chaos, COBWEBS[2][1])
    rows.append(("mu = 3.8: Lyapunov exponent", _NAN, found.lyapunov, ""))
    return frame(rows)


def figure_2_4(system: CamFollower) -> "pd.DataFrame":
    """Figure 2.4 and (2.17): the ratio of the period-doubling cascade."""
    del system
    values = superstable(LogisticMap(), lambda s: s.mu, 0.5, (2.0, 3.24), 12)
    ratios = feigenbaum_ratios(values)
    tail = (values[-1] - values[-2]) / (ratios[-1] - 1)
    rows = [(f"ratio {k + 1}", FEIGENBAUM, r, "") for k, r in enumerate(ratios)]
    rows.append(("end of the cascade", _NAN, values[-1] + tail, ""))
    return frame(rows)


def figure_2_7(system: CamFollower) -> "pd.DataFrame":
    """Figure 2.7: attracting branches on either side of each normal form's point."""
    del system
    expected = {
        "fold": (0, 1),
        "transcritical": (1, 1),
        "pitchfork": (1, 2),
        "hopf": (1, 1),
        "period-doubling": (1, 2),
    }
    rows: list[tuple[str, Any, Any, str]] = []
    for name, form in NORMAL_FORMS.items():
        for mu, printed in zip((-0.2, 0.2), expected[name], strict=True):
            found = sum(bool(form.stable(k, mu)[0]) for k in range(len(form.branches)))
            title = f"{form.title}: attracting branches at mu = {mu}"
            rows.append((title, printed, found, ""))
    return frame(rows)


def figure_2_11(system: CamFollower) -> "pd.DataFrame":
    """Figure 2.11: what the three maps do either side of their border collision."""
    del system
    rows: list[tuple[str, Any, Any, str]] = []
    skew = MAPS["piecewise-linear, continuous"]
    assert isinstance(skew, SkewMap)
    found = border_collision(skew, lambda s: s.mu, 0.2)
    rows.append(("continuous: border collision at mu", 0.0, found.parameter, ""))
    for name, mu in (("continuous", -0.3), ("continuous", 0.3)):
        period = map_attractor(SkewMap(*_numbers(skew.a, skew.b, mu))).period
        rows.append((f"{name}, mu = {mu}: period", _NAN, period, ""))
    for mu in (0.2, 0.3, 0.45, 0.6):
        period = map_attractor(SkewMap(*_numbers(0.5, 0.4, mu, -1.0))).period
        rows.append((f"discontinuous, mu = {mu}: period", _NAN, period, ""))
    root = map_attractor(SquareRootMap(*_numbers(0.5, 0.1)))
    rows.append(("square root, mu = 0.1: Lyapunov exponent", _NAN, root.lyapunov, ""))
    return frame(rows)


class Zeno(NamedTuple):
    """The bouncing ball to its rest, by events and by steps of three lengths."""

    #: accumulation time (2.43)
    exact: float
    run: Trajectory
    #: with the fewest steps
    steps: SteppedMotion
    counts: tuple[int, ...]
    #: accumulation time of each number of steps, and its error (s)
    rests: np.ndarray
    errors: np.ndarray


@cache
def zeno() -> Zeno:
    """Computed once, for the numbers and the drawing."""
    gravity, r = float(_BALL.gravity), float(_BALL.restitution)
    exact = 2 * _LAUNCH / (gravity * (1 - r))
    start, end = np.array([0.0, _LAUNCH]), 1.2 * exact
    counts = (1000, 2000, 4000, 8000, 16000)
    stepped = [moreau(_BALL, start, 0.0, end, steps) for steps in counts]
    rests = np.array([float(one.rests_from()) for one in stepped])
    run = simulate(_BALL, start, 0.0, end)
    return Zeno(exact, run, stepped[0], counts, rests, np.abs(rests - exact))


def figure_2_13(system: CamFollower) -> "pd.DataFrame":
    """Figure 2.13 and (2.43): the Zeno ball, by events and by time-stepping.

    The thesis gives the formula; the ball is one of ours.
    """
    del system
    gravity, r = float(_BALL.gravity), float(_BALL.restitution)
    found = zeno()
    rows: list[tuple[str, Any, Any, str]] = [
        (
            "accumulation time, by events",
            found.exact,
            found.run.contacts.start[-1],
            "s",
        )
    ]
    for steps, rest in zip(found.counts, found.rests, strict=True):
        rows.append((f"accumulation time, {steps} time steps", found.exact, rest, "s"))
    for n in range(3):
        formula = 2 * _LAUNCH / gravity * sum(r**k for k in range(n + 1))
        rows.append((f"impact {n + 1}", formula, found.run.impacts.time[n], "s"))
    return frame(rows)
