"""Define all settings of a diagnosis.

The first group decides a verdict; quantities that follow from the data or from another
setting (the BIC, the error rate per term, the detection limit) are derived. The second
group limits the search: it changes the computing time and should not change the
verdict. A third group selects the content of a report.
"""

import dataclasses
import enum
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from scipy.stats import norm


class Group(enum.StrEnum):
    """The aspect that a setting of a policy can change."""

    VERDICT = "verdict"
    BUDGET = "budget"
    REPORT = "report"


def _decides(default: Any, says: str) -> Any:
    return _number(Group.VERDICT, default, says)


def _bounds(default: Any, says: str) -> Any:
    return _number(Group.BUDGET, default, says)


def _shows(default: Any, says: str) -> Any:
    return _number(Group.REPORT, default, says)


def _number(group: Group, default: Any, says: str) -> Any:
    return dataclasses.field(default=default, metadata={"group": group, "says": says})


class Setting(NamedTuple):
    """One number of a policy: its name, value, group, and what it is."""

    name: str
    value: Any
    group: Group
    says: str


@dataclasses.dataclass(frozen=True, kw_only=True)
class Policy:
    """Settings that decide a verdict, limit a search, and choose the content of a
    report.

    Pass another one to `diagnose(..., policy=Policy(false_alarms=0.05))`. Numbers
    without a unit are ratios or counts; a cost is minus twice the log-likelihood, a
    cost per sample is one where only noise is left. [Discrepancy](../discrepancy.md)
    has the table of all fields, and `settings` gives each with its meaning.

    Raises:
        ValueError: A number is out of its range.

    Examples:
        >>> from jaxcam.discrepancy import Policy
        >>> Policy(false_alarms=0.05).false_alarms
        0.05
    """

    # what decides a verdict
    false_alarms: float = _decides(
        0.01,
        "chance that any term is named where nothing is missing; shared out over the "
        "terms and over the frequencies of a scan (Bonferroni)",
    )
    sure: float = _decides(
        0.9,
        "share of the bootstrap samples that must keep a named term, and chance that "
        "an effect at its detection limit is named",
    )
    most_terms: int = _decides(3, "terms that are named at most")
    form_error: float = _decides(
        0.15,
        "relative error of a term's form that still counts as that term; its square is "
        "the share of the explained cost that may be left over",
    )
    corner_share: float = _decides(
        3e-4,
        "share of what is explained that the smoothed corner of dry friction may "
        "leave; a term beside it that explains less is not named",
    )
    near: float = _decides(
        4.0, "cost per sample below which a fit that has not converged is near the data"
    )
    explains: float = _decides(
        0.5,
        "share of the textbook model's cost that the best subset leaves at most, if "
        "none comes near the data",
    )
    alike: float = _decides(
        1e-8,
        "share of its information that a parameter must keep next to the free ones",
    )
    untold: float = _decides(
        1e-3, "share of the information of all records that one half must hold"
    )
    stretches: int = _decides(4, "bootstrap blocks per record at most")
    stretch_pieces: int = _decides(
        8, "pieces of flight per block at least, redrawn or held out"
    )
    folds: int = _decides(3, "parts of the data, each predicted by the others")
    fewest_periods: float = _decides(
        4.0, "periods in the longest record, at the lowest frequency of a vibration"
    )
    period_samples: float = _decides(
        20.0, "samples per period, at the highest frequency of a vibration"
    )
    period_steps: float = _decides(
        2.5, "steps of a flight per period, at the highest frequency of a vibration"
    )
    residual_lags: int = _decides(
        20, "lags (samples) over which residuals are asked for correlation"
    )
    residual_stretches: int = _decides(
        4, "stretches per record in that test; the worst one does not count"
    )
    velocity_tail: float = _decides(
        0.005, "share of the velocities beyond each end of a free function of velocity"
    )
    drive_wander: float = _decides(
        0.75, "multiple of the drive's rate below which its wandering is no ripple"
    )
    drive_degree: int = _decides(
        5, "degree of the polynomial that takes up the ends of a drive's record"
    )
    drive_orders: tuple[float, ...] = _decides(
        (1.25, 1.4, 1.6, 1.75, 2.25, 2.4, 2.6, 2.75),
        "multiples of the drive's rate, no harmonics, at which leakage is measured",
    )

    odd: float = _decides(
        10.0,
        "ratio of a record's cost per sample to that of every other one, above which "
        "it is set aside",
    )
    records_apart: int = _decides(4, "records at least, for one to be set aside")
    noisier: float = _decides(
        1.2,
        "ratio of the noise that recordings show to that which is stated, above which "
        "the former counts",
    )

    # what bounds the search
    quick_iterations: int = _bounds(15, "iterations of the first fit of a subset")
    iterations: int = _bounds(60, "iterations of a fit that may win")
    heldout_iterations: int = _bounds(15, "iterations of a fit to some of the records")
    state_iterations: int = _bounds(12, "steps of Newton's method on states alone")
    state_gain: float = _bounds(1e-3, "fall of the cost below which they end")
    kept: int = _bounds(3, "subsets of each size that are built upon")
    tried: int = _bounds(6, "subsets of each size above one that are fitted")
    leads: float = _bounds(
        50.0, "BIC within which a subset may lead to a better one than the best"
    )
    helped: float = _bounds(
        0.7, "share of the cost that a term leaves at most, for the search to go on"
    )
    clear: float = _bounds(
        10.0,
        "multiple of what a term is asked for beyond which its loss is not refined",
    )
    astray: float = _bounds(
        3.0, "prior standard errors beyond which a fit starts again from nominal"
    )
    hopeless: float = _bounds(
        2.0, "multiple of the least cost beyond which a fit is not refined"
    )
    explained: float = _bounds(
        1.2, "cost per sample below which a fit explains the data and is not given up"
    )
    crawl_steps: int = _bounds(2, "steps by which a crawling fit is judged")
    crawl_attempts: int = _bounds(4, "attempts that these steps took at least")
    crawl_gain: float = _bounds(
        0.01, "share of the cost to be explained that they gained at most"
    )
    late: int = _bounds(8, "attempts after which a fit must have beaten another one")
    functions: int = _bounds(
        2, "free functions at most, where what is missing has no name; 0 for none"
    )
    elements: int = _bounds(
        0,
        "elements with a state of their own (resonance, relaxation, hysteresis) that "
        "are tried there, one at most; 0 for none",
    )
    function_lengths: tuple[float, ...] = _bounds(
        (0.05, 0.1, 0.2, 0.4, 0.8, 1.6),
        "lengths of correlation tried for a free function: shares of the range of its "
        "argument, radians of a phase",
    )
    function_sizes: tuple[float, ...] = _bounds(
        (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5, 1e6),
        "sizes tried for it, in units of what the data tell of it",
    )
    promising: float = _bounds(
        0.5, "share of the best promise that a free function must make to be fitted"
    )
    rivalling: float = _bounds(
        0.9, "that share where another one explains the data already"
    )
    followed: int = _bounds(3, "free functions and terms that are fitted at each turn")
    heats: int = _bounds(4, "fits of a free function while its prior settles")
    recentred: int = _bounds(
        12, "further fits while the numbers of a hidden element settle"
    )
    heated: float = _bounds(
        1.5, "ratio of costs per sample below which its prior has settled"
    )
    bootstrap: int = _bounds(200, "bootstrap samples of blocks, and of drive records")
    frequency_grid: int = _bounds(4, "frequencies per resolution cell of a scan")
    cause_strengths: tuple[float, float, int] = _bounds(
        (0.1, 1.5, 24),
        "strengths tried for event speeds: the first in sizes, their ratio, how many",
    )
    cause_worse: float = _bounds(
        4.0, "multiple of the least misfit at which larger strengths are not tried"
    )
    cause_difference: float = _bounds(1e-3, "relative step of differences in that fit")
    cause_fits: int = _bounds(40, "evaluations of event speeds in that fit")
    trace_stride: float = _bounds(
        0.1, "stride of the sum of multipliers along a branch of orbits"
    )
    orbit_speeds: tuple[float, ...] = _bounds(
        (1.18, 1.14, 1.22, 1.1, 1.26, 1.32, 1.4),
        "multiples of the detachment speed at which P(1,1) is looked for",
    )
    chatter_speeds: tuple[float, float] = _bounds(
        (1.1, 1.4),
        "multiples of the detachment speed between which chattering is interrupted",
    )
    drawn_rigs: int = _bounds(12, "rigs drawn for the errors of predictions")
    next_speeds: int = _bounds(7, "speeds of the next record that are tried")
    next_beyond: float = _bounds(0.05, "how far beyond the recorded speeds they go")
    next_settle: float = _bounds(6.0, "time (s) a simulated rig takes to settle")

    # what a report shows
    ripple_errors: float = _shows(
        3.0, "standard errors beyond which a record shows the ripple"
    )
    shown_chance: float = _shows(
        1e-3, "chance below which a record shows an effect that was named"
    )
    as_noise: float = _shows(
        1.2, "rms of residuals over noise up to which a caveat is not needed"
    )
    tie: float = _shows(
        10.0,
        "BIC within which another subset is called as good (very strong evidence "
        "beyond it: Kass and Raftery 1995)",
    )
    moved_errors: float = _shows(
        3.0, "standard errors beyond which a summary tells that a parameter has moved"
    )
    rival: float = _shows(
        30.0, "BIC within which the next experiment is to tell another term apart"
    )
    absent_errors: float = _shows(
        10.0, "standard errors that an event speed counts which no longer exists"
    )
    cost_errors: float = _bounds(
        3.0, "standard deviations beyond which a cost is more than noise makes it"
    )
    nearby: float = _shows(
        0.03, "how far from a place data are near it, as a share of the range"
    )
    visited: float = _shows(
        0.1,
        "share of an even density of data that a place must have for a function to be "
        "shown there",
    )
    shape_points: int = _shows(48, "points at which a free function is shown")
    alternatives: int = _shows(8, "alternatives that are listed")

    def __post_init__(self):
        for name in ("false_alarms", "sure", "explains", "form_error"):
            value = getattr(self, name)
            if not 0 < value < 1:
                raise ValueError(
                    f"Policy: `{name}` is {value!r}; give a number between 0 and 1."
                )
        for setting in self.settings():
            if setting.name in ("functions", "elements"):
                continue
            low = min(setting.value) if _several(setting.value) else setting.value
            if not low > 0 or not math.isfinite(low):
                raise ValueError(
                    f"Policy: `{setting.name}` is {setting.value!r}; give positive "
                    f"numbers."
                )

    @property
    def beyond(self) -> float:
        """Standard errors above the threshold at which detection has chance `sure`."""
        return float(norm.ppf(self.sure))

    @property
    def small(self) -> float:
        """Share of the explained cost that may remain, `form_error**2`.

        The likelihood is quadratic in the error of a force.
        """
        return self.form_error**2

    def settings(self) -> Iterator[Setting]:
        """Yield every setting with its group and meaning, in order."""
        for field in dataclasses.fields(self):
            about = field.metadata
            value = getattr(self, field.name)
            yield Setting(field.name, value, about["group"], about["says"])


def _several(value: Any) -> bool:
    return isinstance(value, tuple)
