"""The figure of a diagnosis that ranks other explanations by BIC."""

import textwrap

from ..discrepancy import Diagnosis
from ..discrepancy.report import Alternative, spelled
from ..plotting.colours import FLIGHT, IMPACT


RANKING = (
    "BIC of other explanations minus that of the verdict; the axis is linear in the "
    "grey band and logarithmic outside. Explanations with bars to the left (orange) "
    "have a lower BIC than the verdict; the reason why they were not named is stated "
    "next to the bar. Those to the right (blue) have a higher BIC. Differences within "
    "the grey band are too small to distinguish explanations."
)
# a white box that hides the grid behind a number
_ON_PAPER = {"facecolor": "w", "edgecolor": "none", "pad": 0.8}
# maximum length of a line of a label and of a reason (characters)
_LABEL, _REASON = 42, 30


def ranking(plt, found: Diagnosis):
    """Return the figure, with one bar per explanation."""
    ranked = found.alternatives[: found.policy.alternatives]
    ranked = ranked or (Alternative("none", 0.0, ()),)
    names = [two_lines(spelled(one.name)) for one in ranked]
    deltas = [one.delta_bic for one in ranked]
    rows = len(ranked) + sum(name.count("\n") for name in names) / 2
    figure, axis = plt.subplots(figsize=(8, 0.44 * rows + 1.3), layout="constrained")
    tie = found.policy.tie
    axis.set_xscale("symlog", linthresh=tie, linscale=0.5)
    axis.axvspan(-tie, tie, color="0.9", lw=0)
    axis.axvline(0.0, color="k", lw=1.2)
    for row, (one, delta) in enumerate(zip(ranked, deltas)):
        better = delta < 0
        axis.barh(row, delta, 0.6, color=IMPACT if better else FLIGHT)
        axis.annotate(
            f"{delta:+.3g}", (delta, row), (-4 if better else 4, 0), va="center",
            ha="right" if better else "left", textcoords="offset points",
            fontsize="small", bbox=_ON_PAPER,
        )  # fmt: skip
        if better:
            axis.annotate(
                textwrap.fill(f"not named: {_cause(one)}", _REASON), (0.0, row), (5, 0),
                va="center", textcoords="offset points", fontsize="x-small",
            )  # fmt: skip
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(len(names) - 0.4, -0.6)
    # a margin for the numbers at the ends of the bars
    far = max(1e3, 30 * max(map(abs, deltas)))
    axis.set_xlim(-10 * far if min(deltas) < 0 else -tie, far)
    _few_ticks(axis, far, tie)
    if min(deltas) < 0:
        axis.set_title("← better than the verdict", loc="left", fontsize="small")
    axis.set_title("worse than the verdict →", loc="right", fontsize="small")
    axis.set_xlabel("BIC minus that of the verdict (–)")
    return figure


def _few_ticks(axis, far: float, tie: float) -> None:
    """Put ticks at zero and at powers of ten outside the linear part of the axis."""
    powers, power = [], 10.0 if tie < 10 else 100.0
    while power < far:
        powers.append(power)
        power *= 10
    powers = powers[:: 1 + len(powers) // 4]
    low, _ = axis.get_xlim()
    axis.set_xticks([*(-p for p in reversed(powers) if -p > low), 0.0, *powers])


def _cause(one: Alternative) -> str:
    """Return the reason without the gain in likelihood, which the bar shows."""
    _, but, cause = one.reason.partition(", but ")
    return cause if but else one.reason


def two_lines(name: str) -> str:
    """Return a long name, such as a formula, in at most two lines."""
    lines = textwrap.wrap(name, _LABEL, break_on_hyphens=False)
    if len(lines) > 2:
        lines = [lines[0], f"{lines[1]} …"]
    return "\n".join(lines)
