"""The baseline: sparse regression on derivatives by pysindy (SINDy with control).

The acceleration is regressed on position, velocity and input. The settings are those
with the best free run of the last recording after a fit to the other recordings; the
model is then fitted to all recordings. The choice is among

- windows of the smoothed differences (Savitzky-Golay, cubic). The input passes through
  the same filters as the acceleration, and is taken halfway between its jumps;
- the strong form, or the weak one (integrals with test functions of several lengths);
- polynomials up to degree three, or these with terms of sign and magnitude;
- thresholds of the sequentially thresholded least squares, in units of the rms of each
  quantity.
"""

import functools
import importlib
import importlib.util
import itertools
import math
import time
import warnings
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from benchmarks._textbook_cases import Case
from benchmarks._textbook_runs import error_of, run_freely


pysindy: Any = None
if importlib.util.find_spec("pysindy"):
    pysindy = importlib.import_module("pysindy")


WINDOWS = (1, 5, 9, 17)
# Orders of the differences
ORDERS = (6,)
# Half lengths of the test functions, in samples; None selects the strong form
LENGTHS = (None, 12, 24, 48)
THRESHOLDS = (0.0, 3e-4, 1e-3, 3e-3, 1e-2)
# Number of test functions per recording
_TESTS = 200
# Shortest flight that is used, in windows
_FLIGHT = 2


class Scales:
    """Units in which the quantities have an rms of one."""

    def __init__(self, case: Case, positions, inputs):
        self.x = float(np.std(np.concatenate(positions)))
        speeds = [np.diff(one) * case.rate for one in positions]
        self.v = float(np.std(np.concatenate(speeds)))
        self.u = float(np.std(np.concatenate(inputs)))
        self.t = self.x / self.v


# Features of position, velocity and input, as expressions
POLYNOMIALS = (
    *("1", "u", "x", "v", "x**2", "x*v", "v**2", "x**3", "x**2*v", "x*v**2", "v**3"),
)
SIGNS = ("sign(v)", "abs(x)", "abs(v)", "x*abs(x)", "v*abs(v)", "x*abs(v)", "abs(x)*v")


def _function(expression: str, known):
    return eval(f"lambda x, v, u: {expression} + 0*x", known)


def _library(signs: bool):
    names = POLYNOMIALS + (SIGNS if signs else ())
    known = {"abs": np.abs, "sign": np.sign}
    return pysindy.CustomLibrary(
        [_function(name, known) for name in names],
        [lambda *_, name=name: name for name in names],
    )


def _smooth(values, window: int, times: int) -> Any:
    """Pass values through the filters of the derivatives."""
    for _ in range(times):
        values = savgol_filter(values, window, min(3, window - 1))
    return values


class Regression:
    """A model `acceleration(position, velocity, input)`, and how it was found."""

    def __init__(self, case: Case, terms: dict[str, float], scales: Scales):
        self.case, self.terms, self.scales = case, terms, scales
        known = {"abs": abs, "sign": lambda x: math.copysign(1.0, x) if x else 0.0}
        rows = [f"{value!r}*{name}" for name, value in terms.items()]
        self._value = _function(" + ".join(rows) or "0", known)

    def field(self, state, u):
        """Rate of change of the state."""
        s = self.scales
        x, v = state
        found = self._value(x / s.x, v / s.v, u / s.u)
        return [v, found * s.v / s.t]

    def acceleration(self, states, u) -> np.ndarray:
        """Acceleration along a motion."""
        return np.array([self.field(x[:2], level)[1] for x, level in zip(states, u)])

    @property
    def formula(self) -> str:
        """The model in units of the rms of each quantity."""
        return " ".join(f"{value:+.4g} {name}" for name, value in self.terms.items())


def _flights(motion_time, position, u, impacts, window):
    """Pieces of a recording between the impacts."""
    if not len(impacts):
        return [(position, u)]
    step = motion_time[1] - motion_time[0]
    edges = [0, *np.ceil(np.asarray(impacts) / step).astype(int), len(position)]
    pieces = []
    for first, last in itertools.pairwise(edges):
        if last - first >= _FLIGHT * window + 4:
            pieces.append((position[first:last], u[first:last]))
    return pieces


def _prepared(case: Case, pieces, window: int, order: int, scales: Scales):
    """States, accelerations and inputs of the pieces, in units of their rms."""
    states, bends, inputs = [], [], []
    filters = {"window_length": window, "polyorder": min(3, window - 1)}
    differ = pysindy.SmoothedFiniteDifference(smoother_kws=filters, order=order)
    ends = window // 2 + order // 2
    step = 1 / case.rate / scales.t
    for position, u in pieces:
        time = step * np.arange(len(position))
        x = np.asarray(position)[:, None] / scales.x
        v = np.asarray(differ(x, time)) * scales.x / (scales.v * scales.t)
        a = np.asarray(differ(v, time))
        x = _smooth(x[:, 0], window, 2)
        # the mean of the input before a sample and after it
        halves = (u + np.concatenate([u[:1], u[:-1]])) / 2 / scales.u
        halves = _smooth(halves, window, 2)
        v = _smooth(v[:, 0], window, 1)
        inside = slice(ends, len(x) - ends)
        states.append(np.stack([x, v], axis=1)[inside])
        bends.append(a[inside])
        inputs.append(halves[inside, None])
    return states, bends, inputs


def _fitted(case, prepared, signs, threshold, length, scales) -> Regression:
    states, bends, inputs = prepared
    optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-10, max_iter=30)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if length is None:
            model = pysindy.SINDy(optimizer, _library(signs))
            slopes = [np.hstack([s[:, 1:], a]) for s, a in zip(states, bends)]
            model.fit(states, 1 / case.rate / scales.t, slopes, inputs)
        else:
            model = _weak(case, states, inputs, signs, optimizer, length, scales)
        names, rows = model.get_feature_names(), model.coefficients()
    terms = {n: float(c) for n, c in zip(names, rows[1]) if c != 0}
    return Regression(case, terms, scales)


def _weak(case, states, inputs, signs, optimizer, length, scales):
    """The weak form, with the input as a third state, whose equation is not used."""
    step = 1 / case.rate / scales.t
    shortest = min(map(len, states))
    time = step * np.arange(shortest)
    library = _weak_library(shortest, step, length, signs)
    model = pysindy.SINDy(optimizer, library)
    both = [np.hstack([s, u])[:shortest] for s, u in zip(states, inputs)]
    return model.fit(both, time)


@functools.cache
def _weak_library(count: int, step: float, length: int, signs: bool):
    np.random.seed(0)  # for the positions of the test functions
    return pysindy.WeakPDELibrary(
        _library(signs),
        spatiotemporal_grid=step * np.arange(count),
        K=_TESTS,
        H_xt=length * step,
    )


def regress(case: Case, runs, *, split: bool = False, report=None):
    """Fit the best regression to recordings `(time, position, input, impacts)`.

    With `split`, derivatives are taken within flights, and the free runs that select
    the settings use the true impact law.

    **Returns:** the `Regression`, its settings in words, and the seconds that the
    search took.
    """
    begun = time.time()
    scales = Scales(case, [run[1] for run in runs], [run[2] for run in runs])
    *learnt, last = runs
    law: dict[str, Any] = (
        {"stop": case.stop, "restitution": case.restitution} if split else {}
    )
    best: Any = None
    tried = set()
    for window, order in itertools.product(WINDOWS, ORDERS):
        prepared = _pieces(case, learnt, window, order, scales, split)
        for length, signs, threshold in itertools.product(
            LENGTHS, (False, True), THRESHOLDS
        ):
            if split and length is not None:
                continue
            found = _fitted(case, prepared, signs, threshold, length, scales)
            made = window, order, length, tuple(found.terms)
            if made in tried:
                continue
            tried.add(made)
            run = run_freely(found.field, case.rate, last[2], last[1], **law)
            error = error_of(run, last[1])
            if best is None or error < best[0]:
                best = error, (window, order, length, signs, threshold)
                if report is not None:
                    report(f"{error:.4f} {best[1]} {found.formula}")
    window, order, length, signs, threshold = best[1]
    prepared = _pieces(case, runs, window, order, scales, split)
    found = _fitted(case, prepared, signs, threshold, length, scales)
    form = "strong form" if length is None else f"weak form over {2 * length} samples"
    words = (
        f"window {window}, differences of order {order}, {form}, "
        f"{'with' if signs else 'without'} signs, threshold {threshold:g}, "
        f"{len(found.terms)} terms"
    )
    return found, words, time.time() - begun


def _pieces(case, runs, window, order, scales, split):
    pieces = []
    for times, position, u, impacts in runs:
        pieces += _flights(times, position, u, impacts if split else (), window)
    return _prepared(case, pieces, window, order, scales)
