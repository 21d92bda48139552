"""All settings of a diagnosis.

The first group determines the verdict, the second limits the search and should affect
only the computing time, and the third determines the content of a report. The BIC, the
error rate per term and the detection limit are derived from the data and the settings.
"""

import dataclasses
from collections.abc import Iterator

from scipy.stats import norm

from ._settings import bounds, check, decides, Group as Group, Setting, shows


@dataclasses.dataclass(frozen=True, kw_only=True)
class Policy:
    """Settings that affect the verdict, the search or the report of a diagnosis.

    To change a setting, pass `diagnose(..., policy=Policy(false_alarms=0.05))`. Numbers
    without a unit are ratios or counts. A cost is minus twice the log-likelihood; a
    cost per sample of one means pure noise. [Discrepancy](../discrepancy.md) lists all
    fields in a table, and `settings` yields each with its meaning.

    Raises:
        ValueError: A number is out of range.

    Examples:
        >>> from jaxcam.discrepancy import Policy
        >>> Policy(false_alarms=0.05).false_alarms
        0.05
    """

    # settings that determine the verdict
    false_alarms: float = decides(
        0.01,
        "probability that any term is named although nothing is missing; divided among "
        "the terms and the frequencies of a scan (Bonferroni)",
    )
    confidence: float = decides(
        0.9,
        "fraction of the bootstrap samples that must retain a named term, and "
        "probability that an effect at its detection limit is named",
    )
    most_terms: int = decides(3, "maximum number of named terms")
    form_error: float = decides(
        0.15,
        "maximum relative error of the functional form of a named term; its square is "
        "the largest remaining cost that is tolerated, as a fraction of the explained "
        "cost",
    )
    form_loss: float = decides(
        10.0, "largest increase in BIC from a function to a formula that replaces it"
    )
    tie: float = decides(
        10.0,
        "difference in BIC up to which two explanations count as equally good (a "
        "larger difference is very strong evidence: Kass and Raftery 1995)",
    )
    elsewhere: float = decides(
        0.5,
        "another location is chosen if it reduces the squared residual above the noise "
        "to less than this fraction of the smallest previous value",
    )
    corner_share: float = decides(
        3e-4,
        "largest fraction of the explained cost that is attributed to the smoothing of "
        "dry friction; a term that explains less is not named together with friction",
    )
    separate_gain: float = decides(
        0.5,
        "minimum fraction of the squared residual above the noise that separate "
        "parameter values for each recording must explain",
    )
    common_gain: float = decides(
        0.9,
        "smallest gain, relative to that of separate parameter values, at which a "
        "function common to all recordings is sought",
    )
    near_cost: float = decides(4.0, "cost per sample above which a fit counts as poor")
    knockoffs: int = decides(
        19, "number of knockoffs; a force must explain more than each of its knockoffs"
    )
    explains: float = decides(
        0.5,
        "if the fit is poor: largest cost of a model, as a fraction of the cost of the "
        "model that it extends, at which the extension is accepted",
    )
    distinct_information: float = decides(
        1e-8,
        "minimum fraction of the information on a parameter that must remain when the "
        "other parameters are free",
    )
    half_information: float = decides(
        1e-3,
        "minimum fraction of the information on a term in one half of the recordings "
        "for an estimate from this half",
    )
    stretches: int = decides(4, "maximum number of bootstrap blocks per recording")
    stretch_pieces: int = decides(
        8, "minimum number of flight pieces per bootstrap block or held-out block"
    )
    folds: int = decides(3, "number of parts of the data in the cross-validation")
    fewest_periods: float = decides(
        4.0, "minimum number of periods of a vibration in the longest recording"
    )
    period_samples: float = decides(20.0, "fewest samples allowed per vibration period")
    period_steps: float = decides(
        2.5, "minimum number of integration steps per period of a vibration"
    )
    residual_lags: int = decides(
        20, "number of lags (samples) in the autocorrelation test of the residuals"
    )
    residual_stretches: int = decides(
        4, "sections per recording in the autocorrelation test, the worst being ignored"
    )
    velocity_tail: float = decides(
        0.005, "fraction of velocities excluded at each end of the range of a function"
    )
    drive_wander: float = decides(
        0.75, "speed changes below this multiple of the rotation frequency are drift"
    )
    drive_degree: int = decides(
        5, "degree of the polynomial for speed drift near the ends of a recording"
    )
    drive_orders: tuple[float, ...] = decides(
        (1.25, 1.4, 1.6, 1.75, 2.25, 2.4, 2.6, 2.75),
        "multiples of the rotation frequency at which spectral leakage is measured",
    )
    odd_ratio: float = decides(
        10.0,
        "minimum cost per sample of an inconsistent recording, relative to others",
    )
    odd_share: float = decides(
        0.05,
        "physics may act in a single recording if this fraction of its values is "
        "outside the range of all others, extended by this fraction at both ends",
    )
    records_apart: int = decides(4, "minimum number of recordings to exclude one")
    noisier: float = decides(
        1.2, "ratio of measured to stated noise above which the measured noise is used"
    )
    as_noise: float = decides(
        1.2,
        "ratio of rms residual to noise up to which a residual counts as noise; above "
        "this ratio, a caveat is added",
    )
    cost_errors: float = decides(
        3.0, "largest excess cost, in standard deviations, that is attributed to noise"
    )
    model_error: float = decides(
        100.0,
        "rms residual with the best named terms, in units of the noise, above which "
        "model errors are allowed for",
    )
    resolved: float = decides(
        0.03,
        "if model errors are allowed for: the minimum noise, as a fraction of the rms "
        "residual of the textbook model on single pieces of flight",
    )

    # settings that limit the search
    minutes: float = bounds(
        20.0,
        "time limit in minutes for trying further candidates, measured as if the "
        "machine were otherwise idle",
    )
    named_time: float = bounds(
        0.5, "fraction of the time limit that named terms may use if all fits are poor"
    )
    quick_iterations: int = bounds(15, "iteration limit for the first fit of a subset")
    iterations: int = bounds(60, "iteration limit for the fit of a leading subset")
    heldout_iterations: int = bounds(15, "iteration limit for fits to part of the data")
    state_iterations: int = bounds(12, "limit on Newton steps in a fit of states alone")
    state_gain: float = bounds(
        1e-3, "reduction of the cost per step below which a fit of states alone ends"
    )
    extended_subsets: int = bounds(
        3, "number of subsets of each size that are extended by a further term"
    )
    fitted_subsets: int = bounds(6, "number of subsets fitted for each size above one")
    lead_bic: float = bounds(
        50.0, "a subset or form is tried if its BIC exceeds the best by at most this"
    )
    helpful_cost: float = bounds(
        0.7,
        "while the fit is poor, the search continues only if a term reduces the cost "
        "to less than this fraction of its previous value",
    )
    clear_gain: float = bounds(
        10.0,
        "if the estimated loss of fit without a term exceeds this multiple of the "
        "required gain, the estimated loss is used and no refit is made",
    )
    astray_shift: float = bounds(
        3.0,
        "parameter shift, in prior standard deviations, beyond which a fit restarts",
    )
    hopeless_cost: float = bounds(
        2.0, "multiple of the smallest cost above which a fit is not refined further"
    )
    explained: float = bounds(
        1.2, "cost per sample below which slow convergence does not stop a fit"
    )
    crawl_steps: int = bounds(2, "number of steps used to detect slow convergence")
    crawl_attempts: int = bounds(
        4, "convergence is slow only if the last steps took at least this many attempts"
    )
    crawl_gain: float = bounds(
        0.01, "convergence is slow only if the cost falls by less than this fraction"
    )
    late_attempts: int = bounds(
        8, "number of attempts within which a fit must improve on the subset it extends"
    )
    functions: int = bounds(
        2, "maximum number of free functions for unknown physics; 0: none"
    )
    elements: int = bounds(
        1, "use of elements with internal states; 0: never, 1: if needed, 2: always"
    )
    worthwhile: float = bounds(
        0.1,
        "if model errors are allowed for: minimum fraction of the cost that a further "
        "function must explain",
    )
    element_misfit: float = bounds(
        0.1,
        "if model errors are allowed for: elements are tried only if the cost with "
        "functions exceeds this fraction of the cost of the textbook model",
    )
    function_lengths: tuple[float, ...] = bounds(
        (0.05, 0.1, 0.2, 0.4, 0.8, 1.6),
        "correlation lengths tried for a function, as fractions of the range of its "
        "argument or, for a phase, in radians",
    )
    function_sizes: tuple[float, ...] = bounds(
        (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5, 1e6),
        "amplitudes tried for a function, in mean standard errors of its coefficients",
    )
    promising: float = bounds(
        0.5, "least gain of a candidate, relative to the largest or to the excess cost"
    )
    rivalling: float = bounds(
        0.9,
        "minimum predicted gain, relative to the largest, at which a further function "
        "is fitted although the data are explained",
    )
    followed: int = bounds(
        3, "maximum number of functions, terms, forms or locations tried per stage"
    )
    form_cost: float = bounds(
        1.25, "maximum cost of a form, relative to that of the function it replaces"
    )
    negligible_residual: float = decides(
        0.1,
        "excess cost at which the search ends, relative to the tolerated cost or to "
        "that without the last term",
    )
    prior_fits: int = bounds(
        4, "maximum number of fits for the prior of a free function to converge"
    )
    element_fits: int = bounds(
        12,
        "maximum number of additional fits for the parameters of an element, or of "
        "fits for a reference speed",
    )
    prior_settled: float = bounds(
        1.5, "ratio of consecutive costs below which a function's prior has converged"
    )
    bootstrap: int = bounds(
        200, "number of bootstrap samples, both of blocks and of drive signals"
    )
    frequency_grid: int = bounds(4, "number of scan frequencies per resolution cell")
    cause_strengths: tuple[float, float, int] = bounds(
        (0.1, 1.5, 24),
        "strengths tried in a fit to transition speeds: the first, as a multiple of "
        "the typical strength; the ratio of consecutive strengths; and their number",
    )
    cause_worse: float = bounds(
        4.0, "multiple of the smallest misfit above which no larger strength is tried"
    )
    cause_difference: float = bounds(
        1e-3, "relative step for transition-speed derivatives"
    )
    cause_fits: int = bounds(40, "evaluation limit for a fit to transition speeds")
    trace_stride: float = bounds(
        0.1, "step in the trace of the monodromy matrix along a branch"
    )
    orbit_speeds: tuple[float, ...] = bounds(
        (1.18, 1.14, 1.22, 1.1, 1.26, 1.32, 1.4),
        "multiples of the detachment speed at which P(1,1) is sought",
    )
    chatter_speeds: tuple[float, float] = bounds(
        (1.1, 1.4),
        "multiples of the detachment speed that bracket the interruption of chatter",
    )
    drawn_rigs: int = bounds(12, "number of rigs sampled to estimate prediction errors")
    next_speeds: int = bounds(7, "number of speeds compared for the next recording")
    next_beyond: float = bounds(
        0.05, "relative extension of the recorded speed range at either end"
    )
    next_settle: float = bounds(6.0, "settling time (s) before a simulated recording")

    # settings of the report
    ripple_errors: float = shows(
        3.0, "ripple amplitude, in standard errors, above which a recording is listed"
    )
    shown_chance: float = shows(
        1e-3, "significance level at which a recording shows a named effect"
    )
    decoy: float = shows(
        0.5, "fraction of a function's gain that its decoy may explain without a caveat"
    )
    quieter: float = shows(
        0.5, "ratio of rms residual to stated noise below which a caveat is added"
    )
    units_doubted: float = shows(
        1000.0, "ratio of rms residual to noise above which the units are doubted"
    )
    moved_errors: float = shows(
        3.0, "parameter shift, in standard errors, above which the summary reports it"
    )
    rival: float = shows(
        30.0, "BIC difference below which the next recording should tell rivals apart"
    )
    absent_errors: float = shows(
        10.0, "residual, in standard errors, assigned to an event that does not occur"
    )
    nearby: float = shows(
        0.03, "distance from a point, as a fraction of the range, that counts as near"
    )
    visited: float = shows(
        0.1, "minimum data density, relative to a uniform density, to show a function"
    )
    shape_points: int = shows(144, "number of points on the curve of a function")
    several: int = shows(6, "maximum number of recordings whose values are listed")
    alternatives: int = shows(8, "maximum number of alternatives listed")

    def __post_init__(self):
        check(self.settings())

    @property
    def beyond(self) -> float:
        """Number of standard errors by which an effect must exceed the threshold to be
        detected with probability `confidence`.
        """
        return float(norm.ppf(self.confidence))

    @property
    def small(self) -> float:
        """Fraction of the explained cost that may remain: `form_error**2`, because the
        log-likelihood is quadratic in the error of a force.
        """
        return self.form_error**2

    def settings(self) -> Iterator[Setting]:
        """Yield every setting with its group and meaning, in order."""
        for field in dataclasses.fields(self):
            about, value = field.metadata, getattr(self, field.name)
            yield Setting(field.name, value, about["group"], about["says"])
