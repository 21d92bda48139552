"""Recommend the most informative next recording."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..fitting import Parameter, Problem, Setup, Turning
from ..recordings import (
    record,
    Recording,
    RecordingError,
    Rig,
    segment_case,
    Segments,
    Wandering,
)
from ..recordings.cut import measured_noise
from .report import Diagnosis, slopes_of_function
from .search import Blocks, blocks_of, newton_step
from .terms import FittedFunction, Term, WithTerms


@dataclasses.dataclass(frozen=True)
class Experiment:
    """The expected information of one more recording.

    Examples:
        >>> from jaxcam.discrepancy import Experiment
        >>> Experiment("155 rpm", {"damping": 0.1}, {"damping": 0.05}).factor
        0.5
    """

    name: str
    """Name of the recording."""
    now: Mapping[str, float]
    """Standard errors of the selected parameters without the recording; for a function,
    the rms of its error band.
    """
    then: Mapping[str, float]
    """Standard errors with the recording, in the form of `now`."""
    speed: float | None = None
    """Speed of the cam (rad/s), if there is one."""

    @property
    def factor(self) -> float:
        """Geometric mean of `then / now`."""
        logs = [math.log(self.then[one] / self.now[one]) for one in self.now]
        return math.exp(sum(logs) / len(logs)) if logs else 1.0


def compare_experiments(
    found: Diagnosis,
    records: Sequence[Segments],
    asked: Sequence[str] | None = None,
    *,
    progress: Callable[[str, float | None], None] | None = None,
) -> tuple[Experiment, ...]:
    """Rank proposed recordings by their expected information, the best first.

    The ranking needs only sensitivities: the Fisher information of each proposed
    recording is added to that of the diagnosed recordings. It needs a diagnosis, which
    takes minutes; [The next recording](../discrepancy.md#what-to-record-next) shows an
    example.

    Args:
        found: The diagnosis of the recordings made so far.
        records: Recordings simulated with the diagnosed system (`found.system()`) by
            [`jaxcam.recordings.record`][], and segmented.
        asked: Names of the parameters to be determined. By default, these are the
            strengths of the named terms and the values of the functions found for
            effects outside the library. Alternative terms whose BIC is not much higher
            stay free, so that the best recording also distinguishes them from the named
            ones. By default, if the verdict is `none`, the strengths of all terms are
            determined, one at a time.
        progress: Called with a sentence and a fraction, or `None`.

    Returns:
        The experiments, best first.

    Raises:
        ValueError: A name is not a parameter, or a force with an internal state was
            found; the excitation of such a force is known only for the existing
            recordings.
    """
    _refuse_hidden(found)
    report = progress or (lambda sentence, fraction: None)
    fit = found.after
    for name in asked or ():
        fit.problem.parameter(name)
    report("preparing the proposed recordings", None)
    parameters = [_of_others(one, len(records)) for one in fit.problem.parameters]
    problem = Problem.build(fit.problem.model, records, parameters)
    values = np.repeat(np.asarray(fit.point.values)[:1], len(problem.segments), axis=0)
    point = problem.start._replace(values=jnp.asarray(values))
    # parameters of one recording do not affect another recording
    names = [p.name for p in parameters if p.known is None and not p.per_record]
    report("computing the information of the existing recordings", None)
    known = blocks_of(fit.problem, fit.point, names=names)
    report("computing the information of the proposed recordings", None)
    more = blocks_of(problem, point, names=names)
    questions = _questions(found, asked)
    names = [part.recording.name for part in problem.segments]
    made = []
    for k, name in enumerate(names):
        report("comparing the proposed recordings", k / len(names))
        made.append(
            Experiment(
                name,
                {at: _stderr(known, None, one) for at, one in questions.items()},
                {
                    at: _stderr(known, more.information[k], one)
                    for at, one in questions.items()
                },
                problem.segments[k].recording.nominal_speed,
            )
        )
    return tuple(sorted(made, key=lambda one: one.factor))


def _refuse_hidden(found: Diagnosis) -> None:
    if any(one.element is not None for one in found.missing):
        raise ValueError(
            "Experiments cannot be compared if a force with an internal state was "
            "found; simulate them with `found.system()` and compare the motions."
        )


def _of_others(parameter: Parameter, records: int) -> Parameter:
    """Return a parameter adapted to new recordings: a constant that is known for each
    recording takes its value from the first one.
    """
    if parameter.known is None:
        return parameter
    return dataclasses.replace(parameter, known=parameter.known[:1] * records)


def next_experiments(
    found: Diagnosis,
    rig: Rig | Setup,
    *,
    speeds: Sequence[float] | None = None,
    duration: float | None = None,
    asked: Sequence[str] | None = None,
    seed: int = 0,
    progress: Callable[[str, float | None], None] | None = None,
) -> tuple[Experiment, ...]:
    """Recommend the speeds at which to run a driven rig next, best first.

    [The next recording](../discrepancy.md#what-to-record-next) shows an example.

    Args:
        found: The diagnosis of the recordings made so far.
        rig: As given to `diagnose`.
        speeds: Available speeds of the drive (rad/s); by default, several within and
            slightly beyond the recorded range.
        duration: Duration of a recording (s); by default, that of the existing
            recordings.
        asked: As in [`jaxcam.discrepancy.compare_experiments`][].
        seed: Seed of the simulated noise.
        progress: Called with a sentence and a fraction, or `None`.

    Returns:
        One `Experiment` for each speed, the most informative first.

    Raises:
        ValueError: The rig has no rotating drive.
        RecordingError: No flight occurs at any of the speeds.
    """
    parts = found.after.problem.segments
    drives = [part.drive for part in parts if part.drive is not None]
    _refuse_hidden(found)
    model = found.model(0)
    turning = model.drive
    if not drives or not isinstance(turning, Turning):
        raise ValueError(
            "The next experiment is proposed only for a rig with a drive; simulate "
            "the possible experiments and pass them to `compare_experiments`."
        )
    if speeds is None:
        known = [drive.speed for drive in drives]
        low, high = min(known), max(known)
        beyond, count = found.policy.next_beyond, found.policy.next_speeds
        grid = np.linspace((1 - beyond) * low, (1 + beyond) * high, count)
        speeds = [float(speed) for speed in grid]
    length = parts[0].recording.duration if duration is None else duration
    report = progress or (lambda sentence, fraction: None)
    rng = np.random.default_rng(seed)
    whole: WithTerms = model.system  # pyright: ignore
    slots = {one.slot for one in found.missing}
    terms = tuple(
        t
        for t in _terms(found)
        if (
            t.label in slots if isinstance(t, FittedFunction) else t.name in found.names
        )
        and t.acts
    )
    system = dataclasses.replace(whole, terms=terms)
    channel, encoder = _encoder(rig, parts)
    states = np.asarray(found.after.point.states)[:, 0]
    made = []
    for k, speed in enumerate(speeds):
        report("simulating experiments", k / len(speeds))
        moved = eqx.tree_at(turning.speed, system, jnp.asarray(float(speed)))
        nearest = int(np.argmin([abs(drive.speed - speed) for drive in drives]))
        made.append(
            record(
                Wandering(moved, speed=turning.speed, phase=turning.phase),
                model.sensors,
                length,
                rng=rng,
                # a follower starts from its release point, others from a recorded state
                state=None if isinstance(rig, Rig) else jnp.asarray(states[nearest]),
                settle=found.policy.next_settle,
                interval=parts[0].recording.interval,
                drive=encoder,
                drive_channel=channel,
                name=_named(rig, float(speed)),
            )
        )
    report("segmenting the simulated recordings", None)
    flying = [part for part in _cut(rig, made) if part.flights]
    if not flying:
        raise RecordingError(
            "No flight occurs at any of these speeds; give `speeds` at which the "
            "body leaves its constraint."
        )
    return compare_experiments(found, flying, asked, progress=progress)


def _encoder(
    rig: Rig | Setup, parts: Sequence[Segments]
) -> tuple[str, tuple[float, float]]:
    """Return the channel of the drive, with its noise and resolution (rad)."""
    if isinstance(rig, Rig):
        sensors = rig.sensors
        counts = sensors.cam_counts_per_turn
        return "cam_angle_rad", (sensors.cam_noise, 2 * math.pi / counts)
    assert rig.drive_channel is not None
    noises = [measured_noise(part.recording[rig.drive_channel]) for part in parts]
    return rig.drive_channel, (float(np.median(noises)), 0.0)


def _cut(rig: Rig | Setup, made: Sequence[Recording]) -> Sequence[Segments]:
    return segment_case(made, rig) if isinstance(rig, Rig) else rig.segments(made)


def _named(rig: Rig | Setup, speed: float) -> str:
    """Name a recording by its speed, in rpm for a cam."""
    if isinstance(rig, Rig):
        return f"{speed * 30 / math.pi:.1f} rpm"
    return f"{speed / (2 * math.pi):.4g} Hz"


def _terms(found: Diagnosis) -> tuple[Term, ...]:
    return found.model(0).system.terms  # pyright: ignore


class _Question(NamedTuple):
    """Target quantities: k values with the derivatives `slopes` `(k, p)` with respect
    to the p parameters `own`, which are among the `free` parameters.
    """

    free: list[str]
    own: list[str]
    slopes: Float[np.ndarray, "k p"]


def _of_parameter(free: Iterable[str], name: str) -> _Question:
    return _Question(sorted({*free, name}), [name], np.ones((1, 1)))


def _questions(found: Diagnosis, asked) -> dict[str, _Question]:
    """Return the target quantities (parameters and functions), by name."""
    own = {
        term.name: [one.name for one in term.strengths() if not one.inner]
        for term in _terms(found)
    }
    strengths = {name for names in own.values() for name in names}
    rig = [one for one in found.after.free if one not in strengths]
    named = [name for name in found.names if name in own]
    rivals = {
        part
        for other in found.alternatives
        if other.delta_bic < found.policy.rival
        # subsets that only add terms to the named ones are not alternatives
        and not (named and set(named) <= set(other.terms))
        for part in other.terms
        if part in own
    }
    beside = [one for name in {*named, *rivals} for one in own[name]]
    if asked is not None:
        return {one: _of_parameter([*rig, *beside], one) for one in asked}
    if named or found.missing:
        wanted = [one for name in named for one in own[name]]
        questions = {one: _of_parameter([*rig, *beside], one) for one in wanted}
        for one in found.missing:
            free = sorted({*rig, *beside, *one.numbers})
            slopes = slopes_of_function(found.after, one)
            about = f"{one.kind} as a function of {' and '.join(one.arguments)}"
            questions[about] = _Question(free, list(one.numbers), slopes)
        return questions
    return {one: _of_parameter(rig, one) for names in own.values() for one in names}


def _stderr(known: Blocks, more, question: _Question) -> float:
    """Return the rms standard error of the target quantities when the parameters
    `question.free` are free.
    """
    information, score = known.total()
    if more is not None:
        information = information + more
    rows = known.rows(question.free)
    _, covariance = newton_step(information, score, rows)
    names = [known.names[k] for k in rows]
    own = [names.index(one) for one in question.own]
    slopes = question.slopes * known.scale[rows[own]]
    squares = np.einsum("kp,pq,kq->k", slopes, covariance[np.ix_(own, own)], slopes)
    return float(np.sqrt(np.mean(squares)))
