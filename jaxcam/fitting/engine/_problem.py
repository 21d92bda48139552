"""Build fitting problems from recordings and a model: the interface of the engine.

**Method.** A recording is segmented (`jaxcam.recordings.segment`) into flights,
contacts and impacts. Every flight is divided into pieces of at most 100 samples and
about half a period of the oscillation that it contains. Each piece has its own initial
state and is predicted from it alone, in parallel with all others, so that no prediction
extends beyond the time over which the motion is predictable, even in a chaotic
recording. Pieces are connected by joints, whose conditions follow from the model:

- within a flight, a piece begins where the previous one ends;
- at an impact, two flights meet at the instant at which their gaps are equal (an event,
    not a parameter: it is found by Newton's method and differentiated implicitly).
    There the gap must be zero, and the state after the impact must follow from the
    state before it by the impact law;
- contacts are predicted from the surface alone.

The accuracy of a joint follows from that of the drive as measured by its encoder. The
initial states are eliminated exactly (they form a chain, so the normal equations are
block-tridiagonal); the normal equations of the few parameters remain. One iteration
over six recordings of 4 s at 2 kHz with ten parameters takes about a tenth of a second.

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

**Many fits.** Parameters that are not free cost almost nothing and do not change the
compiled program, as long as the number of free ones, rounded up to a multiple of four,
is the same. Candidates for missing physics are therefore best defined as terms of one
system with zero strengths, all in one problem, and freed by name. `linearise(problem,
fit)` returns the score and information of all parameters at once, free or not, from
which the gain of each candidate follows by linear algebra (`Linearised.gain`).
`weights` (one per piece) omit recordings or blocks without recompilation.
`held_out_cost(problem, found, weights)` is the cost of held-out data: the states of
the held-out pieces are fitted to these data, but the parameters are not.
"""

import dataclasses
from collections.abc import Iterable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from ...recordings import RecordingError, Segments
from ._discrete_states import number_of_discrete_states
from ._extras import Extras
from ._input_jumps import without_jumps
from ._known_constants import known_constants
from ._layout import Layout, strongly_typed
from ._linearise import Point
from ._model import Input, Model
from ._own_states import own_states
from ._parameter import Parameter
from ._pieces import gather, Pieces, Span
from ._problem_checks import (
    parameter_places,
    refuse_many_discrete_states,
    refuse_moved_gaps,
    refuse_not_finite,
    refuse_repeated,
    refuse_switched_outputs,
)
from ._sharpness import joint_sharpness
from ._starts import state_size, suggested_starts
from ._step_size import (
    enough_substeps,
    followed_by_cubics,
    followed_by_lines,
    least_substeps,
    longest_flight,
    steps_for_filters,
    steps_of_samples,
)


# Initial and maximum number of steps of a piece
_STEPS, _MOST_STEPS = 10, 160


class Weights(eqx.Module):
    """Weights of the data of each piece.

    There are r recordings, each with at most k pieces in flight and kc in contact.
    """

    flown: Float[np.ndarray, "r k"]
    """Weight of each piece in flight, shape `(r, k)`."""
    rested: Float[np.ndarray, "r kc"]
    """Weight of each piece in contact, shape `(r, kc)`."""


@dataclasses.dataclass(frozen=True)
class Problem:
    """Recordings, a model, and the parameters that may be fitted.

    It is created by `Problem.build`.

    Examples:
        >>> from jaxcam import fitting, recordings
        >>> from jaxcam.models import BouncingBall
        >>> ball, rng = BouncingBall(), np.random.default_rng(0)
        >>> sensors = {"height_m": fitting.Sensor(0, noise=1e-3)}
        >>> run = recordings.record(ball, sensors, 1.0, rng=rng, state=[1.0, 0.0])
        >>> parts = recordings.segment(run, "height_m", 0.0)
        >>> gravity = fitting.Parameter("gravity", lambda m: m.system.gravity, 1.0)
        >>> model = fitting.Model(ball, sensors)
        >>> problem = fitting.Problem.build(model, [parts], [gravity])
        >>> problem.names
        ('gravity',)
    """

    model: Model
    """The model at its nominal parameters."""
    parameters: tuple[Parameter, ...]
    """Parameters that may be fitted."""
    segments: tuple[Segments, ...]
    """The segmented recordings."""
    pieces: Pieces
    """Pieces of the recordings, as arrays."""
    spans: tuple[tuple[list[Span], list[Span]], ...]
    """Spans of the flights and contacts of each recording."""
    layout: Layout
    """The location of the parameters in the model."""
    start: Point
    """Nominal parameters, and states estimated from the data."""
    extras: Extras
    """Further arguments of the compiled programs."""

    def __post_init__(self):
        # a number from Python and an element of an array need the same program
        object.__setattr__(self, "layout", strongly_typed(self.layout))

    @staticmethod
    def build(
        model: Model, segments: Sequence[Segments], parameters: Sequence[Parameter]
    ) -> "Problem":
        """Divide the recordings into pieces and estimate an initial state for each of
        them.

        Args:
            model: A system with its sensors, at nominal parameters.
            segments: Recordings from `jaxcam.recordings.segment_case` or `segment`;
                their `constants` become parameters that no fit changes.
            parameters: The parameters that may be fitted, free or not.

        Returns:
            A `Problem`.

        Raises:
            RecordingError: A channel is missing, a recording has no flight, or a
                constant is not a number of the system.
            ValueError: A parameter is not a single number of the model, or the model is
                not finite near the data.
        """
        segments = tuple(segments)
        if not segments:
            raise RecordingError("There is no recording to fit; give at least one.")
        model = jax.tree.map(
            lambda leaf: (
                jnp.asarray(leaf, dtype=float) if isinstance(leaf, float) else leaf
            ),
            model,
        )
        constants = known_constants(model, [part.recording for part in segments])
        parameters = (*parameters, *constants)
        discrete = number_of_discrete_states(model, state_size(model))
        refuse_many_discrete_states(model, discrete)
        refuse_moved_gaps(model)
        refuse_switched_outputs(model)
        refuse_repeated(parameters)
        layout = Layout(model, parameter_places(model, parameters))
        nominal = np.array([float(p.where(model)) for p in parameters])
        values = np.tile(nominal, (len(segments), 1))
        for column, one in enumerate(parameters):
            if one.known is not None:
                values[:, column] = one.known
        measured = model.drive if isinstance(model.drive, Input) else None
        steps = _STEPS
        # filtered channels are smooth even where the motion is not, and outputs are
        # noisy, so they do not show how short the pieces must be
        sensors = model.sensors
        flying = [name for name in sensors if sensors[name].in_flight_only]
        curved = [name for name in sensors if name not in flying]
        # with several coordinates, a contact does not show which of them are at rest,
        # so contacts are used only for a single coordinate
        rests = state_size(model) <= 2
        while True:
            pieces, cuts = gather(
                segments, tuple(sensors), steps, measured, curved, rests, flying
            )
            needed = steps_for_filters(model, pieces, steps)
            if needed > steps and steps < _MOST_STEPS:
                steps = min(needed, _MOST_STEPS)
                continue
            states, guess = suggested_starts(model, segments, cuts, pieces)
            begins = jnp.zeros(pieces.joint.shape, dtype=int) if discrete > 1 else None
            point = Point(jnp.asarray(values), jnp.asarray(states), begins)
            refuse_not_finite(layout, segments, pieces, point)
            if steps >= _MOST_STEPS:
                break
            finest = min(steps_of_samples(segments, pieces, steps), _MOST_STEPS)
            if measured is not None and model.system.steep and steps < finest:
                steps = finest
                continue
            if not followed_by_lines(layout, segments, pieces, point, _MOST_STEPS):
                steps = min(2 * steps, finest)
                continue
            if followed_by_cubics(layout, pieces, point):
                break
            steps = min(2 * steps, _MOST_STEPS)
        pieces = without_jumps(layout, segments, pieces, point)
        extras = joint_sharpness(layout, pieces, point, guess)
        pieces = least_substeps(model, segments, pieces)
        pieces = enough_substeps(layout, pieces, extras, point, longest_flight(cuts))
        pieces = jax.tree.map(jnp.asarray, pieces)
        point = own_states(layout, pieces, extras, point)
        if discrete > 1:
            # the discrete states are known only now
            extras = joint_sharpness(layout, pieces, point, guess)
            flight = longest_flight(cuts)
            pieces = enough_substeps(layout, pieces, extras, point, flight)
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
        """Number of fitted samples in all channels."""
        known = self.pieces.flown.known, self.pieces.rested.known
        return int(sum(np.sum(np.asarray(part)) for part in known))

    @property
    def longest_flight(self) -> int:
        """Maximum number of pieces in a flight."""
        return longest_flight(self.spans)

    def parameter(self, name: str) -> Parameter:
        """Return the parameter of this name.

        Raises:
            ValueError: The name is unknown; the message lists the names.
        """
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise ValueError(
            f"There is no parameter {name!r}; the parameters are "
            f"{', '.join(self.names)}."
        )

    def everything(self) -> Weights:
        """Return weights that count all data once."""
        exists, rests = self.pieces.exists, self.pieces.rest_exists
        return Weights(np.asarray(exists, float), np.asarray(rests, float))

    def only(self, records: Iterable[str]) -> Weights:
        """Return weights that count only the given recordings."""
        wanted = set(records)
        if not wanted <= set(self.records):
            raise ValueError(
                f"There is no recording {min(wanted - set(self.records))!r}; the "
                f"recordings are {', '.join(self.records)}."
            )
        keep = np.array([name in wanted for name in self.records], dtype=float)
        every = self.everything()
        return Weights(every.flown * keep[:, None], every.rested * keep[:, None])

    @property
    def begun(self) -> Float[np.ndarray, " records"]:
        """Return the time (s) at which each recording begins."""
        return np.array([part.recording.time[0] for part in self.segments])

    def between(self, start: ArrayLike, stop: ArrayLike) -> Weights:
        """Return weights that count only the pieces of each recording that begin in a
        time span (s); the span may differ between recordings, `(records,)`.

        The example continues the one in [`jaxcam.fitting.fit`][].

        Examples:
            >>> half = fitting.fit(problem, weights=problem.between(0.0, 0.5))
            >>> half.estimates[0].stderr > found.estimates[0].stderr
            True
        """
        low, high = (np.expand_dims(np.asarray(t), -1) for t in (start, stop))

        def inside(samples):
            begin = np.asarray(samples.start)
            return (begin >= low) & (begin < high)

        every = self.everything()
        return Weights(
            every.flown * inside(self.pieces.flown),
            every.rested * inside(self.pieces.rested),
        )

    def weighted(self, weights: Weights | None) -> Extras:
        """Return the arguments of the compiled programs, with given weights."""
        weights = weights or self.everything()
        return self.extras._replace(
            weight=jnp.asarray(weights.flown), rest_weight=jnp.asarray(weights.rested)
        )
