"""From recordings to a verdict: effect, none or unknown."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from ..fitting import Input, Parameter, Sensor
from ..hybrid import HybridSystem
from ..recordings import Recording, Rig, Segments
from ._diagnosis import Diagnosis, Value
from ._effects import drive_effect, ripples, term_effect, unknown_effect
from ._evidence import held_out, limits, redrawn, rms_of, sure
from ._kept_trials import KeptTrials
from ._search import Search
from ._stated import rig_problem, system_problem, turns
from ._structure import Structure, structures
from ._term import Term, terms_of
from ._trials import SURE, Trial, Trials
from ._words import listed, NOISE, summary_of


# What is left over is part of a named effect where it is less than this part of it: a
# force that is 15 % off leaves the square of that in the likelihood
_SHARE = 0.15**2
# Subsets within this BIC of the best one are as good
_TIE = 10.0


def diagnose(
    system: HybridSystem | Rig,
    recordings: Sequence[Recording | Segments],
    candidates: Sequence[Term] | None = None,
    *,
    sensors: Mapping[str, Sensor] | None = None,
    parameters: Sequence[Parameter] = (),
    drive: Input | None = None,
    case: str = "",
    seed: int = 0,
    progress: Callable[[str, float | None], None] | None = None,
    keep: Path | None = None,
) -> Diagnosis:
    """What physics a model leaves out, from recordings of the real thing.

    **Arguments:**

    - `system`: a `Rig` from `jaxcam.recordings.read_rig`, which knows its sensors and
        tolerances; or any system with one coordinate, with what follows.
    - `recordings`: at least two of a rig; of another system, what
        `jaxcam.recordings.segment` makes of them.
    - `candidates`: terms that may be named; by default `library()`. Those that are not
        `listed` only help to describe what is unknown.
    - `sensors`, `parameters`, `drive`: as for `jaxcam.fitting.Model` and `Problem`, of
        a system that is not a rig; the drive is an input that was measured.
    - `seed`: of the redrawn blocks.
    - `progress`: called with a sentence and a fraction, or `None`.
    - `keep`: a folder in which fits are kept until the diagnosis is done; one that was
        interrupted goes on from there.

    **Raises:** `RecordingError` for recordings from which nothing can be told, with one
    sentence that says why.
    """
    report = progress or (lambda sentence, fraction: None)
    recordings = tuple(recordings)
    if isinstance(system, Rig):
        problem, rig, terms, unlisted, ripple = rig_problem(
            system, recordings, candidates, report
        )
    else:
        problem, rig, terms, unlisted = system_problem(
            system, recordings, candidates, sensors, parameters, drive, report
        )
        ripple = None
    turned = isinstance(system, Rig) or turns(problem)
    kept = None if keep is None else KeptTrials(keep, problem)
    trials = Trials(problem, rig, terms, report, kept)
    best = Search(trials).run()
    report("redrawing stretches of the records", None)
    found = best
    best, inclusion, deviation, doubtful = sure(trials, found, seed)
    before = trials.known[frozenset()]
    report("looking at what is left over", None)

    def left(trial: Trial) -> list[Structure]:
        response, scan = trials.response(trial.names), trials.scan(trial.names)
        return structures(trial.fit, response, unlisted, scan, turned)

    left_before = left(before)
    left_after = left(best) if best.names else left_before
    held, named_anyway = None, []
    if doubtful and any(one.significant for one in left_after):
        # that something is there is sure; what explains all of it is what it is
        with_all = left(found)
        if not any(one.significant for one in with_all):
            whole = held_out(trials, before, found, report)
            # but what does not foretell data that it has not seen explains nothing; it
            # is asked for no more than a shape would be
            if whole[1] < whole[0] or trials.foretells(best, found):
                best, left_after, held = found, with_all, whole
                named_anyway, doubtful = doubtful, []
                inclusion, deviation = redrawn(trials, best, seed)
    held = held or held_out(trials, before, best, report)
    rms_before, rms_after, gained, unseen = held
    effects = [
        term_effect(trials, best, before, name, inclusion, deviation, gained)
        for name in sorted(best.names)
    ]
    if ripple is not None and ripples(ripple, len(terms) + 1):
        effects.append(drive_effect(ripple))
    unexplained = [one for one in left_after if one.significant]
    verdict, caveats = _verdict(effects, unexplained, before, best)
    caveats += [_doubt(name, part) for name, part in doubtful]
    caveats += [_needed(name, part) for name, part in named_anyway]
    if verdict == "unknown":
        effects.insert(0, unknown_effect(unexplained, problem, gained))
    if not trials.settled(found):
        caveats.append(_astray(trials))
    alternatives = _alternatives(trials, best)
    for name, delta in alternatives:
        # what was found to hang on a few stretches of the records is no equal
        if abs(delta) < _TIE:
            caveats.append(
                f"These records cannot tell {listed(sorted(best.names))} from "
                f"{name.replace('_', ' ')}: the BIC differs by {delta:.1f} only. "
                f"Record larger and smaller bounces, and speeds further apart."
            )
    caveats += [
        f"Something that differs from record to record is left over ({one.sentence}): "
        f"it is no physics that they share; look at how they were recorded."
        for one in left_after
        if one.gain > one.asked and one.foretold <= 0
    ][:1]
    if effects and rms_after > max(rms_before, NOISE):
        caveats.append(
            "A part of the records does not pin the parameters down well enough to "
            f"predict the others: it misses by {rms_after:.2g} times the noise, the "
            f"textbook model by {rms_before:.2g}. Record at more speeds."
        )
    if kept is not None:
        kept.clear()
    floor = float(next(iter(problem.model.sensors.values())).floor)
    least = limits(trials, best)
    units = {one.name: one.unit for t in terms for one in t.strengths()}
    names = [effect.name for effect in effects]
    return Diagnosis(
        case,
        verdict,
        tuple(effects),
        tuple(alternatives),
        rms_before * floor,
        rms_after * floor,
        floor,
        _unit(next(iter(problem.model.sensors))),
        _rig_values(system, best, deviation),
        summary_of(
            verdict,
            effects,
            unexplained,
            best,
            before,
            rig,
            least,
            units,
            rms_of(best.fit),
            rms_after,
        ),
        before.fit,
        best.fit,
        tuple(left_before),
        tuple(left_after),
        unseen,
        ripple,
        _pulls(trials, before, best),
        {
            name: Value(size, stderr, units[name])
            for name, (size, stderr, _) in least.items()
            if name not in names
        },
        {name: hidden for name, (_, _, hidden) in least.items()},
        tuple(caveats),
    )


def _unit(channel: str) -> str:
    """The unit that ends the name of a channel, as in `height_m`."""
    for unit, written in (("_rad_s", "rad/s"), ("_rad", "rad"), ("_m", "m")):
        if channel.endswith(unit):
            return written
    return ""


def _verdict(effects, unexplained: list[Structure], before: Trial, best: Trial):
    caveats = []
    if not unexplained:
        return ("effect" if effects else "none"), caveats
    left = max(one.gain for one in unexplained)
    explained = before.fit.cost - best.fit.cost
    if best.names and left < _SHARE * explained:
        caveats.append(
            f"Something small is left over ({unexplained[0].sentence}, "
            f"{unexplained[0].place}): {left / explained:.1%} of what was explained. "
            f"The effect may have a slightly different form."
        )
        return "effect", caveats
    return "unknown", caveats


def _doubt(name: str, part: float) -> str:
    """Why a term that gains something was not named."""
    return (
        f"A term for {name.replace('_', ' ')} gains something, but {_but(part)}; "
        f"record more before you believe it."
    )


def _needed(name: str, part: float) -> str:
    """Why a term was named that is in doubt."""
    return (
        f"The term for {name.replace('_', ' ')} is named because nothing is left over "
        f"with it, but {_but(part)}; record more to know its strength."
    )


def _astray(trials: Trials) -> str:
    """That no fit comes near the data, and how near the best one comes."""
    least = min(trials.known.values(), key=lambda trial: trial.fit.cost)
    named = listed(sorted(least.names)) if least.names else "none of them"
    return (
        f"No subset of the known effects comes near these records: the best fit, with "
        f"{named}, misses by {rms_of(least.fit):.2g} times the noise. What is said of "
        f"shape and place is rough."
    )


def _but(part: float) -> str:
    """What speaks against a term: in how many redrawn sets of stretches it gains."""
    if part >= SURE:
        return "its strength varies so much between stretches that it might be zero"
    return f"it gains in {part:.0%} of the redrawn sets of stretches only"


def _alternatives(trials: Trials, best: Trial) -> list[tuple[str, float]]:
    found = [
        ("+".join(sorted(names)) or "none", trial.bic - best.bic)
        for names, trial in trials.known.items()
        # a superset is the same explanation with more
        if names != best.names and not names > best.names
    ]
    return sorted(found, key=lambda one: one[1])[:8]


def _rig_values(system, best: Trial, deviation) -> dict[str, Value]:
    found = {}
    for one in best.fit.estimates:
        if one.name not in search_names(best):
            continue
        stderr = max(one.stderr, deviation.get(one.name, 0.0))
        value, unit = one.value, one.unit
        name = one.name
        if isinstance(system, Rig) and name == "stiffness":
            inertia = system.inertia.value
            name, value, stderr = "K/J", value / inertia, stderr / inertia
            unit = "1/(m^2 s^2)"
        found[name] = Value(value, stderr, unit)
    return found


def search_names(best: Trial) -> set[str]:
    """Parameters of the rig among those of a fit."""
    problem = best.fit.problem
    terms = terms_of(problem.model)
    own = {one.name for term in terms for one in term.strengths()}
    return set(best.fit.free) - own


def _pulls(trials: Trials, before: Trial, best: Trial):
    found = {}
    for name in trials.rig:
        parameter = trials.problem.parameter(name)
        place = trials.problem.names.index(name)
        nominal = float(trials.problem.start.values[0, place])
        size = parameter.size(nominal)
        found[name] = (
            (before.fit[name].value - nominal) / size,
            (best.fit[name].value - nominal) / size,
        )
    return found
