"""The report of `jaxcam diagnose` as one HTML file, section by section."""

import math
from collections.abc import Sequence
from html import escape
from pathlib import Path

from ..discrepancy import Diagnosis, library, Verdict
from ..discrepancy.evidence import Structure
from ..discrepancy.report import listed, number, spelled
from ..tables import scaled
from ._changed import changed
from ._outlook import Outlook
from ._page import figure_html, prose, sentences, STYLE, table_html
from ._residual_axes import REACH


# Fewest and most digits of a fitted value
_FEWEST, _MOST = 3, 10
_PARTS = {"flight": "in flight", "impact": "at impacts", "contact": "in contact"}


def diagnosis_page(
    found: Diagnosis,
    figures: Sequence[tuple[Path, str]],
    notes: Sequence[str],
    outlook: Outlook = Outlook(),
) -> str:
    """Return the page as HTML text that needs no other files."""
    title = f"{found.case or 'Recordings'}: {_title(found)}"
    parts = [
        f"<h1>{escape(title)}</h1>",
        *(f'<p class="sentence">{prose(s)}</p>' for s in sentences(found.summary)),
        *(f'<p class="note">{prose(note)}</p>' for note in notes),
        *_effects(found),
        *_before_and_after(found),
        *(figure_html(file, caption) for file, caption in figures),
        *_caveats(found),
        *_alternatives(found),
    ]
    for one in outlook.tables():
        parts += [
            f"<h2>{one.title}</h2>",
            table_html(one.headings, one.rows, text=(0,)),
            f'<p class="note">{prose(one.note)}</p>',
        ]
    if outlook.reason:
        parts.append(f'<p class="note">{prose(outlook.reason)}</p>')
    parts += [*_left_over(found), *_parameters(found), *_limits(found)]
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n"
        "<body>\n" + "\n".join(parts) + "\n</body>\n</html>\n"
    )


def _title(found: Diagnosis) -> str:
    if found.verdict == Verdict.EFFECT:
        return listed(found.names)
    if found.verdict == Verdict.NONE:
        return "no missing physics detected"
    named = [effect.name for effect in found.effects if effect.term]
    unnamed = [
        f"unnamed {one.kind} ({', '.join(one.arguments)})" for one in found.missing
    ]
    return listed([*named, *(unnamed or ["unknown physics"])])


def _effects(found: Diagnosis) -> list[str]:
    if not found.effects:
        return []
    headings = (
        "effect",
        "parameters",
        "where",
        "fraction of the misfit",
        "residual / noise without it",
        "delta BIC",
        "bootstrap inclusion",
    )
    rows = [
        (
            spelled(effect.name),
            ", ".join(
                f"{name} = {number(v.value, v.stderr, v.unit)}"
                for name, v in effect.parameters.items()
            ),
            effect.where,
            "" if effect.share is None else f"{effect.share:.1%}",
            "" if effect.rms_without is None else f"{effect.rms_without:.3g}",
            f"{effect.delta_bic:.0f}",
            "" if effect.inclusion is None else f"{effect.inclusion:.0%}",
        )
        for effect in found.effects
    ]
    return [
        "<h2>Missing physics</h2>",
        table_html(headings, rows, text=(0, 1, 2)),
        *_own_gains(found),
        *_per_mass(found),
        *_knockoffs(found),
    ]


def _own_gains(found: Diagnosis) -> list[str]:
    """Explain the evidence for each effect, and state that for all of them."""
    if not any(effect.rms_without is not None for effect in found.effects):
        return []
    gain = max(effect.heldout_gain_nats for effect in found.effects)
    with_all = math.sqrt(found.after.cost / found.after.problem.samples)
    return [
        '<p class="note">The residual / noise is the predicted rms residual of all '
        "samples if this effect alone is removed and everything else is adjusted, in "
        f"units of the sensor noise; it is {with_all:.3g} with all effects. Delta BIC "
        "is the BIC with the effect minus that without it. Together, the effects "
        f"increase the log-likelihood of held-out data by {gain:.3g}.</p>"
    ]


def _per_mass(found: Diagnosis) -> list[str]:
    """Explain the unit of the strengths of forces."""
    if not any(effect.where in ("flight", "contact") for effect in found.effects):
        return []
    return [
        '<p class="note">The strengths of forces are per unit mass: multiply by the '
        "mass (of an angle: by the moment of inertia) to obtain a force (a torque)."
        "</p>"
    ]


def _knockoffs(found: Diagnosis) -> list[str]:
    """Compare each unnamed force with functions that take its arguments at other
    moments.
    """
    return [
        f"<p>The unnamed force ({escape(', '.join(one.arguments))}) was compared with "
        f"{one.knockoffs[0]} functions of the same kind that take their arguments at "
        f"other moments of the recordings: the best of them explains "
        f"{one.knockoffs[1]:.1%} of what the force explains.</p>"
        for one in found.missing
        if one.knockoffs is not None
    ]


def held_out_error(found: Diagnosis) -> str:
    """Return a sentence on the held-out error, in the unit of the figures."""
    factor, unit = scaled(found.unit, REACH * found.noise_floor)
    after = ""
    if changed(found):
        after = f" and {factor * found.heldout_after:.3g} with the missing effects"
    return (
        f"The error on held-out flights is {factor * found.heldout_before:.3g} {unit} "
        f"with the textbook model{after}; the noise and rounding of the sensor amount "
        f"to {factor * found.noise_floor:.3g}."
    )


def _before_and_after(found: Diagnosis) -> list[str]:
    parts = [
        "<h2>Error on held-out flights</h2>",
        f"<p>{prose(held_out_error(found))}</p>",
    ]
    if found.misfit:
        where = listed(f"{s:.0%} is {_PARTS[part]}" for part, s in found.misfit.items())
        parts.append(f"<p>Of the misfit of the textbook model, {where}.</p>")
    return parts


def _caveats(found: Diagnosis) -> list[str]:
    if not found.caveats:
        return []
    items = "".join(f"<li>{prose(caveat.sentence)}</li>" for caveat in found.caveats)
    return ["<h2>Caveats</h2>", f"<ul>{items}</ul>"]


def _alternatives(found: Diagnosis) -> list[str]:
    if not found.alternatives:
        return []
    rows = [
        (
            spelled(one.name),
            f"{one.delta_bic:+.3g}",
            one.reason,
        )
        for one in found.alternatives
    ]
    return [
        "<h2>Other explanations</h2>",
        table_html(("terms", "delta BIC", "why it was not named"), rows, text=(0, 2)),
        '<p class="note">Delta BIC is the BIC of each explanation minus that of the '
        "verdict.</p>",
    ]


def _left_over(found: Diagnosis) -> list[str]:
    rows = [
        (
            spelled(one.name),
            one.where,
            f"{one.gain:.1f}",
            f"{one.threshold:.1f}",
            _significance(one),
        )
        for one in found.left_after
    ]
    if not rows:
        # the table is not computed for a model with unnamed functions
        return []
    headings = ("free function", "where", "gain", "threshold", "significant")
    return [
        "<h2>Remaining structure in the residuals</h2>",
        table_html(headings, rows, text=(0, 1, 4)),
        '<p class="note">The gain is the predicted increase in twice the '
        "log-likelihood if the free function is added to the model. The threshold "
        "follows from the false-alarm rate and the number of coefficients.</p>",
    ]


def _significance(one: Structure) -> str:
    """Say whether a correction is significant; if not, although its gain exceeds the
    threshold, give the reason.
    """
    if one.significant:
        return "yes"
    return "no: differs between recordings" if one.gain > one.threshold else "no"


def _parameters(found: Diagnosis) -> list[str]:
    columns = 2 if changed(found) else 1
    rows = [
        (name, _fitted(found, name), *(f"{one:+.2f}" for one in pulls[:columns]))
        for name, pulls in found.pulls.items()
    ]
    headings = (
        "parameter",
        "fitted value",
        "deviation: textbook model",
        "deviation: with the missing effects",
    )
    note = (
        "Fitted values are given with their standard errors. A deviation is the "
        "difference from the rig file, in units of the tolerance stated there."
    )
    if changed(found):
        note += (
            " The fitted values are those of the model with the missing effects. A "
            "parameter that deviates in the textbook model but not with the missing "
            "effects compensated for the missing physics."
        )
    return [
        "<h2>Parameters of the rig</h2>",
        table_html(headings[: 2 + columns], rows, text=(0,)),
        f'<p class="note">{note}</p>',
    ]


def _fitted(found: Diagnosis, name: str) -> str:
    """Return a fitted value with all of its significant digits."""
    one = found.rig.get(name)
    if one is None:
        return ""
    digits = _FEWEST
    if one.value and 0 < one.stderr < math.inf:
        places = (math.floor(math.log10(x)) for x in (abs(one.value), one.stderr))
        digits = next(places) - next(places) + 1
    digits = min(max(digits, _FEWEST), _MOST)
    unit = "" if one.unit == "-" else one.unit
    return f"{one.value:.{digits}g} +- {one.stderr:.1g} {unit}".rstrip()


def _limits(found: Diagnosis) -> list[str]:
    effects = {
        one.name: term.name
        for term in library(extended=True)
        for one in term.strengths()
    }
    rows = [
        (
            spelled(effects.get(name, "")),
            name,
            f"{one.value:.2g} {'' if one.unit == '-' else one.unit}".rstrip(),
            found.hides.get(name, "").replace("_", " "),
        )
        for name, one in found.limits.items()
    ]
    if not rows:
        return []
    headings = (
        "effect",
        "parameter",
        "smallest detectable strength",
        "mostly absorbed by",
    )
    return ["<h2>Detection limits</h2>", table_html(headings, rows, text=(0, 1, 3))]
