"""Which record to make next: the one that would say most about what is asked."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..fitting import Parameter, Problem
from ..recordings import record, RecordingError, Rig, segment_case, Segments, Wandering
from .report import Diagnosis
from .search import Blocks, blocks_of, newton_step
from .terms import Term, WithTerms


@dataclasses.dataclass(frozen=True)
class Experiment:
    """What one more record would say.

    - `name`: of the record.
    - `now`, `then`: standard errors of the parameters asked for, without and with it.
    - `speed`: of the cam (rad/s), where there is one.
    """

    name: str
    now: Mapping[str, float]
    then: Mapping[str, float]
    speed: float | None = None

    @property
    def factor(self) -> float:
        """Geometric mean of `then` over `now`."""
        logs = [math.log(self.then[one] / self.now[one]) for one in self.now]
        return math.exp(sum(logs) / len(logs)) if logs else 1.0


def compare_experiments(
    found: Diagnosis, records: Sequence[Segments], asked: Sequence[str] | None = None
) -> tuple[Experiment, ...]:
    """What each of some records would say, the best first, before they are made.

    From the sensitivities alone: the Fisher information of each record is added to that
    of the records of the diagnosis.

    **Arguments:**

    - `records`: simulated with the system that was found (`found.system()`) by
        [`jaxcam.recordings.record`][], and cut.
    - `asked`: names of parameters; by default the strengths of what was named. The
        terms whose BIC is not much worse stay free beside them, so that the best record
        also tells them apart. Where nothing was named, all terms, one at a time.

    **Raises:** `ValueError` for a name that is no parameter, or where a force with a
        state of its own was found: what drove it is known of the records that there
        are alone.
    """
    _refuse_hidden(found)
    fit = found.after
    for name in asked or ():
        fit.problem.parameter(name)
    parameters = [_of_others(one, len(records)) for one in fit.problem.parameters]
    problem = Problem.build(fit.problem.model, records, parameters)
    values = np.repeat(np.asarray(fit.point.values)[:1], len(problem.segments), axis=0)
    point = problem.start._replace(values=jnp.asarray(values))
    # what each record has for itself says nothing of another one
    names = [p.name for p in parameters if p.known is None and not p.per_record]
    known = blocks_of(fit.problem, fit.point, names=names)
    more = blocks_of(problem, point, names=names)
    questions = _questions(found, asked)
    names = [part.recording.name for part in problem.segments]
    made = [
        Experiment(
            name,
            {one: _stderr(known, None, rows, one) for one, rows in questions.items()},
            {
                one: _stderr(known, more.information[k], rows, one)
                for one, rows in questions.items()
            },
            problem.segments[k].recording.nominal_speed,
        )
        for k, name in enumerate(names)
    ]
    return tuple(sorted(made, key=lambda one: one.factor))


def _refuse_hidden(found: Diagnosis) -> None:
    if any(one.element is not None for one in found.missing):
        raise ValueError(
            "Experiments are not compared where a force with a state of its own was "
            "found; simulate them with `found.system()` and look at the motion."
        )


def _of_others(parameter: Parameter, records: int) -> Parameter:
    """A parameter that is known of each record, for others: as in the first one."""
    if parameter.known is None:
        return parameter
    return dataclasses.replace(parameter, known=parameter.known[:1] * records)


def next_experiments(
    found: Diagnosis,
    rig: Rig,
    *,
    speeds: Sequence[float] | None = None,
    duration: float | None = None,
    asked: Sequence[str] | None = None,
    seed: int = 0,
    progress: Callable[[str, float | None], None] | None = None,
) -> tuple[Experiment, ...]:
    """The speed at which to run a cam-follower rig next, the best first.

    **Arguments:**

    - `found`: what `diagnose` said of its records so far.
    - `speeds`: of the cam (rad/s) that can be had; by default some between those of
        the records and a little beyond.
    - `duration`: of a record (s); by default as before.
    - `asked`: as in [`jaxcam.discrepancy.compare_experiments`][].

    **Raises:** `ValueError` for a system that is no rig with a drive; `RecordingError`
    where none of the speeds makes the follower fly.
    """
    parts = found.after.problem.segments
    drives = [part.drive for part in parts if part.drive is not None]
    _refuse_hidden(found)
    if not drives:
        raise ValueError(
            "The next experiment is proposed for a rig with a drive; simulate the "
            "experiments that you can make and give them to `compare_experiments`."
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
    model = found.model(0)
    base = model.system.base  # pyright: ignore
    terms = tuple(t for t in _terms(found) if t.name in found.names and t.acts)
    system = WithTerms(base, terms)
    sensors = rig.sensors
    encoder = sensors.cam_noise, 2 * math.pi / sensors.cam_counts_per_turn
    made = []
    for k, speed in enumerate(speeds):
        report("simulating experiments", k / len(speeds))
        moved = eqx.tree_at(_speed, system, jnp.asarray(float(speed)))
        made.append(
            record(
                Wandering(moved, speed=_speed, phase=_phase),
                model.sensors,
                length,
                rng=rng,
                settle=found.policy.next_settle,
                interval=parts[0].recording.interval,
                drive=encoder,
                name=f"{float(speed) * 30 / math.pi:.1f} rpm",
            )
        )
    report("weighing experiments", None)
    flying = [part for part in segment_case(made, rig) if part.flights]
    if not flying:
        raise RecordingError(
            "The follower would rest on the cam at all of these speeds; give `speeds` "
            "at which it flies."
        )
    return compare_experiments(found, flying, asked)


def _speed(system: WithTerms):
    return system.base.speed  # pyright: ignore


def _phase(system: WithTerms):
    return system.base.phase  # pyright: ignore


def _terms(found: Diagnosis) -> tuple[Term, ...]:
    return found.model(0).system.terms  # pyright: ignore


def _questions(found: Diagnosis, asked) -> dict[str, list[str]]:
    """Parameters that are asked for, and all that are free beside each."""
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
        for part in other.terms
        if part in own
    }
    beside = [one for name in {*named, *rivals} for one in own[name]]
    if asked is not None:
        return {one: sorted({*rig, *beside, one}) for one in asked}
    if named:
        wanted = [one for name in named for one in own[name]]
        return {one: sorted({*rig, *beside, one}) for one in wanted}
    return {one: sorted({*rig, one}) for names in own.values() for one in names}


def _stderr(known: Blocks, more, names: Sequence[str], one: str) -> float:
    """Standard error of one parameter where some are free."""
    information, score = known.total()
    if more is not None:
        information = information + more
    rows = known.rows(names)
    _, covariance = newton_step(information, score, rows)
    place = int(np.flatnonzero([known.names[k] == one for k in rows])[0])
    return float(np.sqrt(covariance[place, place]) * known.scale[rows[place]])
