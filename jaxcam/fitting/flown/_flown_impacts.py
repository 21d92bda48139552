"""Find the impacts of a recording with flights of the model."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ...hybrid import SwitchedSystem
from ...recordings import Recording
from ...recordings.cut import (
    Drive,
    given_contacts,
    GivenImpact,
    GivenImpacts,
    hides_kinks,
    measured_noise,
)
from ..engine import Layout, Model, Parameter, parameter_places
from ._impacts import Search
from ._record import record_of
from ._windows import Flyer


# Fewest samples on either side of an impact from which it is assessed
_FEWEST = 12
# The number of samples of a prediction is rounded up to a multiple of this, so that
# similar recordings share a program
_SHARED = 32
# Samples beyond a window at which its flight is predicted: a number, and a fraction of
# an oscillation
_MARGIN, _SEARCHED = 3, 40
# Smallest standard error of the time of an impact, in samples
_LEAST_STDERR = 1e-6


def located(
    model: Model,
    parameters: Sequence[Parameter],
    recording: Recording,
    gaps: Float[np.ndarray, "g k"],
    errors: Float[np.ndarray, " g"],
    drive: Drive | None,
    period: float,
) -> GivenImpacts | None:
    """Return the impacts of a recording, or `None` if they can be seen without a model.

    **Arguments:** the model and the parameters to fit; the gaps at every sample and
    their largest errors; the `drive`, if it has an encoder; the shortest `period` of
    the oscillations of the gaps (s).
    """
    # a step of the integration must not cross a switching surface
    if isinstance(model.system, SwitchedSystem):
        return None
    if not hides_kinks(period, recording.interval):
        return None
    model = jax.tree.map(
        lambda leaf: jnp.asarray(leaf) if isinstance(leaf, float) else leaf, model
    )
    interval = recording.interval
    reach = max(_FEWEST, round(period / interval))
    margin = _MARGIN + reach // _SEARCHED
    width = _SHARED * -(-2 * (reach + margin) // _SHARED)
    values = np.array([float(one.where(model)) for one in parameters])
    sizes = np.array([p.size(float(v)) for p, v in zip(parameters, values)])
    layout = Layout(model, parameter_places(model, parameters))
    record = record_of(model, recording, drive, period)
    flyer = Flyer(layout, record, values, sizes, width, margin)
    noises = np.array([measured_noise(gap) for gap in gaps])
    search = Search(flyer, parameters, gaps, noises, errors, reach)
    given = _given(recording, search, search.run())
    contacts = given_contacts(recording, gaps, list(errors), given)
    if contacts:
        # no flight describes a contact; the impacts near it depend on its ends
        given = _given(recording, search, search.again(contacts))
    return given


def _given(
    recording: Recording, search: Search, met: list[GivenImpact]
) -> GivenImpacts:
    begin, interval = float(recording.time[0]), recording.interval
    found = [
        one._replace(
            time=begin + one.time,
            time_stderr=max(one.time_stderr, _LEAST_STDERR * interval),
        )
        for one in met
    ]
    return GivenImpacts(tuple(found), search.described())
