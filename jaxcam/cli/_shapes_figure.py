"""The figure of a diagnosis that shows the remaining structures as functions."""

from typing import NamedTuple

from ..discrepancy import Diagnosis
from ..discrepancy.evidence import Structure
from ..discrepancy.terms import Variable
from ..plotting.colours import IMPACT
from ..plotting.labels import labelled
from ._changed import changed


# maximum number of corrections shown
_MOST = 4
_TEXTBOOK = "0.45"


class _Panel(NamedTuple):
    """A correction of the final model, and of the textbook model if that differs."""

    one: Structure
    textbook: Structure | None


def has_shapes(found: Diagnosis) -> bool:
    """Return whether a correction is significant, or shows the missing effects, or no
    effect is missing.
    """
    if not (found.left_after and changed(found)):
        return True
    return any(one.significant for one in _drawn(found)) or bool(_relevant(found))


def caption(found: Diagnosis) -> str:
    """Return the caption of the figure."""
    after = changed(found) and bool(found.left_after)
    model = "the model with the missing effects" if after else "the textbook model"
    panels = _panels(found)
    if _relevant(found) is not None:
        start = (
            f"No correction of {model} is significant. The one shown was the largest "
            "of the textbook model in the part of the motion in which the missing "
            "effects act."
        )
    elif not any(panel.one.significant for panel in panels):
        start = f"The largest correction of {model}; it is not significant."
    elif len(panels) == 1:
        start = f"The only significant correction of {model}."
    else:
        start = f"The most significant corrections of {model}, at most {_MOST}."
    grey = (
        " Grey: the same correction of the textbook model, in which one missing effect "
        "may appear in several corrections."
        if any(panel.textbook is not None for panel in panels)
        else " One missing effect may appear in several of them; the verdict gives the "
        "explanation that fits the data best."
        if changed(found) and not after
        else ""
    )
    return (
        f"{start} Each is estimated alone as a free function, with a band of twice the "
        f"standard error (where it is wider than the line).{grey} The rig parameters, "
        "such as the stiffness, are free: a part of the curve that they can represent, "
        "such as a constant slope, is ambiguous."
    )


def shapes(plt, found: Diagnosis):
    """Return the figure, with one panel per correction."""
    panels = _panels(found)
    columns = min(2, max(len(panels), 1))
    rows = max(1, -(-len(panels) // columns))
    figure, axes = plt.subplots(
        rows,
        columns,
        figsize=(4.8 * columns, 0.3 + 2.9 * rows),
        layout="constrained",
        squeeze=False,
    )
    for axis in axes.flat[len(panels) :]:
        axis.axis("off")
    if not panels:
        axes[0, 0].text(
            0.5, 0.5, "no correction can be drawn as a function", ha="center"
        )
    for axis, panel in zip(axes.flat, panels):
        _draw(axis, panel)
    return figure


def _panels(found: Diagnosis) -> list[_Panel]:
    """Return the significant corrections; if there are none, the one that shows the
    missing effects in the textbook model, or the largest one.
    """
    drawn = _drawn(found)
    relevant = _relevant(found)
    kept = [one for one in drawn if one.significant][:_MOST] or drawn[:1]
    kept = kept if relevant is None else [relevant]
    textbook = {}
    if found.left_after and changed(found):
        textbook = {one.name: one for one in found.left_before if len(one.grid)}
    return [_Panel(one, textbook.get(one.name)) for one in kept]


def _drawn(found: Diagnosis) -> list[Structure]:
    """Return the corrections that can be drawn, the most significant first."""
    final = found.left_after or found.left_before
    drawn = [one for one in final if len(one.grid)]
    return sorted(drawn, key=lambda one: one.gain - one.threshold, reverse=True)


def _relevant(found: Diagnosis) -> Structure | None:
    """Return the correction whose value in the textbook model shows the missing effects
    best, if the effects leave no significant correction.
    """
    drawn = _drawn(found)
    if not found.left_after or any(one.significant for one in drawn):
        return None
    named = {one.name: one for one in drawn}
    acts = {effect.where for effect in found.effects if effect.term}
    earlier = [
        one
        for one in found.left_before
        if one.significant
        and one.where in acts
        and one.name in named
        # an effect changes with the motion, not with the time of the recording
        and one.variable != Variable.TIME
    ]
    best = max(earlier, key=lambda one: one.gain, default=None)
    return None if best is None else named[best.name]


def _draw(axis, panel: _Panel) -> None:
    one, before = panel
    if before is not None:
        _band(axis, before, _TEXTBOOK)
    _band(axis, one, IMPACT)
    axis.axhline(0.0, color="k", lw=0.6)
    axis.margins(x=0, y=0.1)
    if before is not None:
        _name(axis, before, one, _TEXTBOOK, "textbook\nmodel")
        _name(axis, one, before, IMPACT, "with the\nmissing\neffects")
    axis.set_title(_evidence(one), fontsize="small")
    axis.set_xlabel(labelled(one.variable, one.argument_unit))
    axis.set_ylabel(labelled(one.quantity, one.unit.replace("^2", "²")))


def _evidence(one: Structure) -> str:
    """Return whether a correction is significant, with the numbers that decide."""
    if one.gain > one.threshold and not one.significant:
        return "not significant: differs between recordings"
    word = "significant" if one.significant else "not significant"
    return f"{word}: gain in 2 ln L {one.gain:.3g},\n{one.threshold:.3g} required"


def _band(axis, one: Structure, color) -> None:
    low, high = one.value - 2 * one.stderr, one.value + 2 * one.stderr
    axis.fill_between(one.grid, low, high, color=color, alpha=0.3, lw=0)
    for edge in (low, high):
        axis.plot(one.grid, edge, color=color, lw=0.6, alpha=0.8)
    axis.plot(one.grid, one.value, color=color, lw=1.4)


def _name(axis, one: Structure, other: Structure, color, words: str) -> None:
    """Write a label at the right end of a curve, on the side away from the other
    curve.
    """
    end = one.value[-1]
    side = "bottom" if end >= other.value[-1] else "top"
    axis.annotate(
        words, (one.grid[-1], end), (6, 0), textcoords="offset points", va=side,
        color=color, fontsize="small", annotation_clip=False,
    )  # fmt: skip
