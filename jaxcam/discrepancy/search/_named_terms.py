"""Add terms of the library to a model."""

import dataclasses
from collections.abc import Sequence

from ...fitting import Input, Model, Parameter, Turning
from ...recordings import Recording, References, Segments
from ...recordings.cut import fast_speed
from ...recordings.files import unit_of
from ..terms import coordinates, library, system_with_terms, Term
from ._motion_scales import motion_scales
from ._of_base import channel_of, measured_in, of_base, usual_state, within


def with_terms(
    model: Model,
    parameters: Sequence[Parameter],
    terms: Sequence[str | Term],
    recordings: Sequence[Recording | Segments],
) -> tuple[Model, list[Parameter]]:
    """Add physics to a model, for `fit` or `fit_free_run`.

    Args:
        model: The model without these terms.
        parameters: Its parameters.
        terms: Names from `library(extended=True)`, or terms of your own that act on the
            first coordinate. Their strengths are initially zero.
        recordings: Recordings from which the terms take their scales: the range of the
            positions, typical speeds and accelerations, and the width (a speed) of the
            `tanh` that smooths dry friction at zero velocity.

    Returns:
        The model with the terms in its system, and all parameters.

    Raises:
        ValueError: The library has no term of this name.

    Examples:
        >>> from jaxcam.discrepancy import with_terms
        >>> from jaxcam.fitting import Model, Sensor
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.recordings import Recording
        >>> time = 1e-3 * np.arange(200)
        >>> fallen = Recording("drop", time, {"height_m": 1.0 - 4.905 * time**2})
        >>> model = Model(BouncingBall(), {"height_m": Sensor(0, noise=1e-4)})
        >>> _, found = with_terms(model, [], ["quadratic_drag"], [fallen])
        >>> [one.name for one in found]
        ['c2']
    """
    runs = [r.recording if isinstance(r, Segments) else r for r in recordings]
    sensors = model.sensors
    pairs = coordinates(model.system, usual_state(model.system, sensors, runs))
    seen = channel_of(sensors, pairs[0][0])
    references = References.of_speed(fast_speed(runs, seen))
    scales = motion_scales(runs, seen, sensors[seen], references.slip_speed)
    references = dataclasses.replace(references, spring_center=scales.middle)
    known = {
        term.name: term
        for term in library(references=references, clocked=True, extended=True)
    }
    wrong = [one for one in terms if isinstance(one, str) and one not in known]
    if wrong:
        raise ValueError(
            f"There is no term {wrong[0]!r}; the terms are {', '.join(known)}."
        )
    picked = [known[one] if isinstance(one, str) else one for one in terms]
    scaled = [term.scaled(scales) for term in picked]
    placed = measured_in(unit_of(seen), scaled)
    drive: Turning | Input | None = of_base(model.drive)
    more = [p for k, term in enumerate(placed) for p in term.parameters(k)]
    system = system_with_terms(model.system, placed, pairs)
    return Model(system, sensors, drive), [*map(within, parameters), *more]
