"""Recordings and a model, ready to be fitted: the engine's front door.

**How it works.** A recording is cut (`jaxcam.recordings.segment`) into flights,
contacts and impacts. Every flight is cut again into pieces of at most 50 ms. Each piece
has an initial state of its own and is predicted from it alone, all pieces of all
records side by side, so nothing is predicted over longer than it can be known; a
chaotic record is as good as any other. Pieces are tied together by what the model says
of their joints:

- within a flight, a piece begins where the one before it ends;
- at an impact, two flights meet at the instant at which their gaps agree (an event, not
  a parameter: found by Newton and differentiated implicitly). There the gap must be
  zero and the motion after be the impact law of the motion before;
- contacts are predicted from the surface alone.

A joint is as sharp as the drive is known, by its encoder. The initial states are
eliminated exactly (they form a chain, hence block-tridiagonal normal equations); what
remains are the normal equations of the few parameters. One iteration over six records
of 4 s at 2 kHz with ten parameters takes about a tenth of a second.

**Use.**

```python
model = Model(system, {"follower_angle_rad": Sensor(0, noise=8e-5)}, drive)
parameters = [
    Parameter("stiffness", lambda m: m.system.stiffness, tolerance=8.0),
    Parameter("friction", lambda m: m.system.friction, lower=0.0),
    Parameter("lag", lambda m: m.sensors["follower_angle_rad"].lag, per_record=True),
]
problem = Problem.build(model, segments, parameters)
found = fit(problem)                                  # everything free
null = fit(problem, free=["stiffness"])               # the others stay where they are
again = fit(problem, start=null, weights=problem.only(problem.records[:4]))
found["stiffness"].value, found["stiffness"].stderr, found.covariance, found.model(0)
```

**Many fits.** Parameters that are not free cost next to nothing and do not change the
compiled program, as long as the number of free ones, rounded up to a multiple of four,
is the same. So candidates for missing physics are best stated as terms of one system
with strengths of zero, all in one problem, and freed by name. `linearise(problem, fit)`
gives score and information of all parameters at once, free or not: what each candidate
would gain is then linear algebra (`Linearised.gain`). `weights` (one a piece) leave
records or blocks out without compiling anew; `held_out_cost(problem, found, weights)`
is what a fit says of data it has not seen: the states of their pieces are fitted to
them, the parameters are not.
"""

import dataclasses
from collections.abc import Iterable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..recordings import RecordingError, Segments
from ..recordings._flight_fit import state_at
from ..recordings._polynomial import fit_local
from ._linear import Extras, Sharpness
from ._linearise import assemble, Layout, Point
from ._model import filtered_channels, Input, Model
from ._parameter import Parameter
from ._pieces import gather, IMPACT, Pieces, Span
from ._predict import fly


# Steps of a piece to begin with, and at most
_STEPS, _MOST_STEPS = 10, 160
# Change (in units of the noise) that halving the steps may make
_STEP_ERROR = 0.01
# Step over time constant of a filter: Hermite's error is then 1e-4 of a jump
_FILTER_STEP = 0.4
_WIDTH = 4
# A joint within a flight is this much sharper than what its samples say of the state
_JOINT = 1e-3
# An impact is this much sharper than what the flights on both sides say of themselves:
# a tenth of their variance is next to nothing to lose, and it forgets what chaos and
# small faults of the model make of the past
_IMPACT = 10**-0.5


class Weights(eqx.Module):
    """How much the data of each piece count: `(r, k)` in flight, `(r, kc)` at rest."""

    flown: Float[np.ndarray, "r k"]
    rested: Float[np.ndarray, "r kc"]


@dataclasses.dataclass(frozen=True)
class Problem:
    """Recordings, a model, and the parameters of it that may be fitted.

    Built by `Problem.build`.

    - `model`: at its nominal parameters.
    - `parameters`: what may be fitted.
    - `records`: names of the recordings.
    - `pieces`, `spans`: what the recordings were cut into.
    - `start`: the nominal parameters and the states that the data suggest.
    """

    model: Model
    parameters: tuple[Parameter, ...]
    segments: tuple[Segments, ...]
    pieces: Pieces
    spans: tuple[tuple[list[Span], list[Span]], ...]
    layout: Layout
    start: Point
    extras: Extras

    @staticmethod
    def build(
        model: Model, segments: Sequence[Segments], parameters: Sequence[Parameter]
    ) -> "Problem":
        """Cut the recordings into pieces and find a state to start each of them from.

        **Arguments:**

        - `model`: a system with its sensors, at nominal parameters.
        - `segments`: recordings from `jaxcam.recordings.segment_case` or `segment`.
        - `parameters`: those that may be fitted, free or not.

        **Raises:** `RecordingError` for a missing channel or a record without flight;
        `ValueError` for a parameter that is not one number of the model.
        """
        segments = tuple(segments)
        if not segments:
            raise RecordingError("There is no recording to fit; give at least one.")
        parameters = tuple(parameters)
        _refuse_repeated(parameters)
        model = jax.tree.map(
            lambda leaf: (
                jnp.asarray(leaf, dtype=float) if isinstance(leaf, float) else leaf
            ),
            model,
        )
        layout = Layout(model, _places(model, parameters))
        nominal = np.array([float(p.where(model)) for p in parameters])
        values = np.tile(nominal, (len(segments), 1))
        measured = model.drive.channel if isinstance(model.drive, Input) else None
        steps, first, extras = _STEPS, _STEPS, None
        while True:
            pieces, cuts = gather(segments, tuple(model.sensors), steps, measured)
            if steps < _MOST_STEPS and not _follows(model, segments, pieces):
                steps *= 2
                continue
            states, guess = _starts(model, segments, cuts, pieces)
            point = Point(jnp.asarray(values), jnp.asarray(states))
            if extras is None:
                # as a scale of errors, that of the first steps will do for all
                extras, first = _extras(layout, pieces, point, guess), steps
            if steps >= _MOST_STEPS or _fine(layout, pieces, extras, point):
                break
            steps *= 2
        if steps > first:
            extras = _extras(layout, pieces, point, guess)
        pieces = jax.tree.map(jnp.asarray, pieces)
        return Problem(
            model,
            parameters,
            segments,
            pieces,
            tuple(cuts),
            layout,
            point,
            extras,
        )

    @property
    def records(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return tuple(part.recording.name for part in self.segments)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def samples(self) -> int:
        """Number of samples of all channels that are fitted."""
        known = self.pieces.flown.known, self.pieces.rested.known
        return int(sum(jnp.sum(part) for part in known))

    @property
    def longest_flight(self) -> int:
        """Number of pieces of the flight that has most of them."""
        pieces = (np.array([span.flight for span in side]) for side, _ in self.spans)
        counts = (np.unique(part, return_counts=True)[1] for part in pieces)
        return max(int(np.max(count, initial=0)) for count in counts)

    def parameter(self, name: str) -> Parameter:
        """**Raises:** `ValueError` that lists the names there are."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise ValueError(
            f"There is no parameter {name!r}; the parameters are "
            f"{', '.join(self.names)}."
        )

    def everything(self) -> Weights:
        """All data count once."""
        exists, rests = self.pieces.exists, self.pieces.rest_exists
        return Weights(np.asarray(exists, float), np.asarray(rests, float))

    def only(self, records: Iterable[str]) -> Weights:
        """Only some records count. **Raises:** `ValueError` for an unknown name."""
        wanted = set(records)
        if not wanted <= set(self.records):
            raise ValueError(
                f"There is no record {min(wanted - set(self.records))!r}; the records "
                f"are {', '.join(self.records)}."
            )
        keep = np.array([name in wanted for name in self.records], dtype=float)
        every = self.everything()
        return Weights(every.flown * keep[:, None], every.rested * keep[:, None])

    def between(self, start: float, stop: float) -> Weights:
        """Only pieces that begin in some span of time (s of each record) count."""

        def inside(samples):
            begin = np.asarray(samples.start)
            return (begin >= start) & (begin < stop)

        every = self.everything()
        return Weights(
            every.flown * inside(self.pieces.flown),
            every.rested * inside(self.pieces.rested),
        )

    def weighted(self, weights: Weights | None) -> Extras:
        """What the compiled programs need, with some weights."""
        weights = weights or self.everything()
        return self.extras._replace(
            weight=jnp.asarray(weights.flown), rest_weight=jnp.asarray(weights.rested)
        )


def _refuse_repeated(parameters) -> None:
    names = [parameter.name for parameter in parameters]
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise ValueError(
            f"Two parameters are called {min(repeated)!r}; rename one of them."
        )


def _places(model: Model, parameters) -> tuple[int, ...]:
    """Index of each parameter among the leaves of a model."""
    leaves, tree = jax.tree.flatten(model)
    numbered = jax.tree.unflatten(tree, list(range(len(leaves))))
    places = []
    for parameter in parameters:
        place = parameter.where(numbered)
        if not isinstance(place, int) or np.shape(leaves[place]) != ():
            raise ValueError(
                f"The parameter {parameter.name!r} is not one number of the model; let "
                f"`where` pick a field that holds a single number."
            )
        if place in places:
            other = parameters[places.index(place)].name
            raise ValueError(
                f"The parameters {other!r} and {parameter.name!r} are the same number; "
                f"leave one of them out."
            )
        places.append(place)
    return tuple(places)


def _size(model: Model) -> int:
    from ..recordings._compare import _size as size_of

    return size_of(model.system, {n: s.observe for n, s in model.sensors.items()})


def _starts(model: Model, segments, cuts, pieces: Pieces):
    """States that polynomials through the samples suggest, shape `(r, k, n)`."""
    size = _size(model)
    lags = filtered_channels(model)
    sensors = model.sensors
    direct = [name for name in sensors if name not in lags] or list(sensors)
    states = np.zeros((*pieces.joint.shape, size + len(lags)))
    guess = np.zeros((*pieces.rest_exists.shape, size))
    for row, (part, sides) in enumerate(zip(segments, cuts)):
        for side, found in zip(sides, (states, guess)):
            if not side:
                continue
            clock = np.array([span.start for span in side])
            local = [
                [_local(part, span, name, sensors[name]) for name in direct]
                for span in _with_samples(side)
            ]
            both = np.array(local)
            picks = [sensors[name].observe for name in direct]
            system = _still(model, part)
            state = state_at(system, picks, clock, both[..., 0], both[..., 1], size)
            found[row, : len(side), :size] = state
            if found is states:
                for place, name in enumerate(lags):
                    seen = jax.vmap(sensors[name].seen)(jnp.asarray(state))
                    found[row, : len(side), size + place] = seen
    return states, guess


def _still(model: Model, part: Segments):
    """The system with its drive at the mean speed; its field serves as a guide only."""
    if part.drive is None:
        return model.system
    # arrays: numbers would be constants of a program that is compiled for each record
    angle, rate = (jnp.asarray(x) for x in (part.drive.phase, part.drive.speed))
    return model.driven(0.0, angle, rate)


def _with_samples(side: list[Span]):
    """Pieces too short for a polynomial borrow the samples of their neighbours."""
    for k, span in enumerate(side):
        if len(span.rows) >= 4:
            yield span
            continue
        near = [s for s in side[max(0, k - 1) : k + 2] if s.flight == span.flight]
        rows = np.concatenate([s.rows for s in near])
        yield dataclasses.replace(span, rows=rows)


def _local(part: Segments, span: Span, channel: str, sensor):
    """Value and slope of a channel at the beginning of a piece."""
    time = part.recording.time[span.rows]
    values = part.recording[channel][span.rows]
    fine = np.isfinite(values)
    if np.sum(fine) < 2:
        return 0.0, 0.0
    fit = fit_local(time[fine], values[fine], float(sensor.floor), span.start)
    return fit.value(span.start), fit.slope(span.start)


def _extras(layout: Layout, pieces: Pieces, point: Point, guess) -> Extras:
    """How sharp the joints are: as sharp as the drive, and as the samples can tell."""
    records, width = pieces.joint.shape
    size = point.states.shape[-1]
    one = jnp.ones((records, width, size))
    extras = Extras(
        jnp.asarray(guess),
        Sharpness(one, one, one[..., 0]),
        jnp.asarray(pieces.exists, dtype=float),
        jnp.asarray(pieces.rest_exists, dtype=float),
    )
    # as wide as a fit of everything, which then is compiled already
    none = jnp.zeros((records, width_of(len(layout.places))), dtype=int)
    alone = eqx.tree_at(lambda p: p.joint, pieces, jnp.zeros_like(pieces.joint))
    blocks, _ = assemble(
        layout, alone, extras, point, none, jnp.zeros(none.shape, dtype=float)
    )
    information = jnp.diagonal(blocks.ss, axis1=-2, axis2=-1)
    usual = jnp.nanmedian(jnp.where(information > 0, information, jnp.nan), axis=(0, 1))
    # a state that no sample sees is tied as tightly as the least visible one
    usual = jnp.where(jnp.isnan(usual), jnp.nanmin(usual), usual)
    floor = _JOINT / jnp.sqrt(usual)
    flight = jnp.broadcast_to(floor, one.shape)
    sharp = extras._replace(sharpness=Sharpness(flight, flight, one[..., 0]))
    inner = jnp.where(jnp.asarray(pieces.joint) == IMPACT, 0, pieces.joint)
    flights = eqx.tree_at(lambda p: p.joint, pieces, inner)
    blocks, _ = assemble(
        layout, flights, sharp, point, none, jnp.zeros(none.shape, dtype=float)
    )
    known = _IMPACT**2 * _variances(np.asarray(blocks.ss), np.asarray(blocks.before))
    before = np.concatenate([known[:, :1], known[:, :-1]], axis=1)
    known = jnp.asarray(np.minimum(known, before))
    slope, by_drive = _drive_slopes(layout, pieces, point)
    gap = jnp.sqrt(jnp.sum(slope**2 * known, axis=-1) + by_drive[..., -1] ** 2)
    impact = jnp.sqrt(known + by_drive[..., :-1] ** 2)
    return extras._replace(sharpness=Sharpness(flight, impact, gap))


def loosened(extras: Extras) -> Extras:
    """Joints within flights that give as much as the samples of a piece allow.

    States that the data suggest do not join. Where a flight has many pieces, to close
    them all at once would be to foretell the last one from the first, with parameters
    that are not yet known.
    """
    sharpness = extras.sharpness
    return extras._replace(
        sharpness=sharpness._replace(flight=sharpness.flight / _JOINT)
    )


def _variances(ss, before):
    """Variance of each state from the samples of its own flight, shape `(r, k, n)`."""
    records, width, size, _ = ss.shape
    found = np.zeros((records, width, size))
    for r in range(records):
        matrix = np.zeros((width, size, width, size))
        for k in range(width):
            dead = np.diagonal(ss[r, k]) <= 0
            matrix[k, :, k] = ss[r, k] + np.diag(dead.astype(float))
            if k:
                matrix[k, :, k - 1] = before[r, k]
                matrix[k - 1, :, k] = before[r, k].T
        flat = matrix.reshape(width * size, -1)
        scale = 1 / np.sqrt(np.diagonal(flat))
        inverse = np.linalg.inv(flat * np.outer(scale, scale))
        found[r] = (np.diagonal(inverse) * scale**2).reshape(width, size)
    return np.abs(found)


@eqx.filter_jit
def _drive_slopes(layout: Layout, pieces: Pieces, point: Point):
    """Slope of the gap, `(r, k, n)`, and errors of an impact due to the drive."""

    def one(values, state, t, angle, rate, error):
        model = layout.at(values)
        size = state.shape[0] - len(filtered_channels(model))

        def landed(drive):
            system = model.driven(t, drive[0], drive[1])
            x = system.impact(t, state[:size])
            gap = jnp.min(jnp.atleast_1d(system.gap(t, state[:size])))
            if x.ndim == 2:
                x = x[jnp.argmin(system.gap(t, state[:size]))]
            return jnp.concatenate([x, state[size:], gap[None]])

        def gap_of(x):
            system = model.driven(t, angle, rate)
            return jnp.min(jnp.atleast_1d(system.gap(t, x[:size])))

        jacobian = jax.jacfwd(landed)(jnp.stack([angle, rate]))
        spread = jnp.sqrt(jacobian**2 @ error**2)
        return jax.grad(gap_of)(state), spread

    along = jax.vmap(one, in_axes=(None, 0, 0, 0, 0, None))
    return jax.vmap(along)(
        point.values,
        point.states,
        jnp.asarray(pieces.flown.start),
        jnp.asarray(pieces.angle_at),
        jnp.asarray(pieces.rate_at),
        jnp.asarray(pieces.drive_error),
    )


def _follows(model: Model, segments, pieces: Pieces) -> bool:
    """Whether the steps are short beside the filters of the sensors, and the input.

    A filter is not at rest after an impact, which the states to begin with do not show.
    """
    longest = float(np.max(np.where(pieces.exists, pieces.flown.step, 0.0)))
    interval = min(part.recording.interval for part in segments)
    if isinstance(model.drive, Input) and longest > interval:
        return False
    corners = [2 * np.pi * s.bandwidth_hz for s in model.sensors.values() if s.filtered]
    return all(longest * corner <= _FILTER_STEP for corner in corners)


def _fine(layout: Layout, pieces: Pieces, extras: Extras, point: Point) -> bool:
    """Whether half the steps would change no state by a part of its error."""
    half = jax.tree.map(
        lambda part: np.repeat(part, 2, axis=-1), (pieces.angle, pieces.rate)
    )
    part = pieces.flown
    coarse = _ends(layout, point, part.start, part.step, pieces.angle, pieces.rate)
    fine = _ends(layout, point, part.start, part.step / 2, *half)
    change = np.abs(coarse - fine) / (np.asarray(extras.sharpness.flight) / _JOINT)
    return bool(np.max(np.where(pieces.exists[..., None], change, 0.0)) < _STEP_ERROR)


@eqx.filter_jit
def _ends(layout: Layout, point: Point, start, step, angle, rate):
    def one(values, *piece):
        model = layout.at(values)
        return jax.vmap(lambda *inputs: fly(model, *inputs)[0])(*piece)

    drive = (jnp.asarray(part) for part in (start, step, angle, rate))
    return jax.vmap(one)(point.values, point.states, *drive)


def width_of(number: int) -> int:
    """Columns that programs are compiled for: a multiple of four, to share them."""
    return _WIDTH * max(1, -(-number // _WIDTH))
