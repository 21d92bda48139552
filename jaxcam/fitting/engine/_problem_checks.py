"""Reject an invalid problem before fitting; each message is a sentence."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...hybrid import SwitchedSystem
from ...hybrid.lowering import used_inputs
from ...hybrid.programs import program
from ._layout import Layout
from ._linearise import Point
from ._model import augmented_field, Input, Model
from ._output import Output
from ._pieces import Pieces
from ._starts import state_size


# Largest number of discrete states of a system to fit
_MOST_DISCRETE = 16


def refuse_not_finite(layout: Layout, segments, pieces: Pieces, point: Point) -> None:
    """Raise `ValueError` for a vector field that is not finite near the data."""
    rates = np.asarray(_rates(layout, point, pieces))
    bad = pieces.exists & ~np.all(np.isfinite(rates), axis=-1)
    if np.any(bad):
        r, k = np.argwhere(bad)[0]
        state = ", ".join(f"{x:.4g}" for x in np.asarray(point.states)[r, k])
        raise ValueError(
            f"The model is not finite in {segments[r].recording.name} at "
            f"{pieces.flown.start[r, k]:.4g} s, where the state estimated from the "
            f"data is ({state}); check its vector field and the nominal parameters."
        )


@program
def _rates(layout: Layout, point: Point, pieces: Pieces):
    """Return the rate of change at the initial state of each piece."""

    def one(values, states, start, drive):
        model = layout.at(values)

        def at(state, t, drive):
            return augmented_field(model, model.driven(t, drive), t, state)

        return jax.vmap(at)(states, start, drive)

    begin = jnp.asarray(pieces.flown.start), pieces.drive_at
    return jax.vmap(one)(point.values, point.states, *begin)


def refuse_many_discrete_states(model: Model, count: int) -> None:
    """Raise `ValueError` for a system with more discrete states than can be tried at
    the beginning of every piece.
    """
    if count > _MOST_DISCRETE:
        raise ValueError(
            f"{type(model.system).__name__} has {count} discrete states (modes, and "
            f"sides of the surfaces of a class with `hysteresis`), and a fit tries "
            f"each of them at the beginning of every piece of a recording. State it "
            f"with at most {_MOST_DISCRETE}, or let `remembered_sides` return only "
            f"the sides of the surfaces that have hysteresis."
        )


def refuse_switched_outputs(model: Model) -> None:
    """Raise `ValueError` for a sensor of the rate of change of a system with modes."""
    if not isinstance(model.system, SwitchedSystem):
        return
    for name, sensor in model.sensors.items():
        if isinstance(sensor.observe, Output):
            raise ValueError(
                f"{name} is an output, such as that of an accelerometer, of a system "
                "with switching surfaces, where it jumps; leave this channel out."
            )


def refuse_moved_gaps(model: Model) -> None:
    """Raise `ValueError` if a gap depends on the measured input: the velocity of the
    surface, which an impact needs, would be unknown.
    """
    source = model.drive
    if not isinstance(source, Input):
        return

    def gaps_of(level, state):
        system = eqx.tree_at(source.value, model.system, level)
        return system.gap(jnp.zeros(()), state)

    level, state = jnp.zeros(()), jnp.zeros(state_size(model))
    if used_inputs(jax.make_jaxpr(gaps_of)(level, state))[0]:
        raise ValueError(
            f"A gap of {type(model.system).__name__} depends on the input "
            f"{source.channel!r}, but the velocity of a surface cannot be computed "
            "from a measured input. Use the position relative to this surface as a "
            "coordinate, with the acceleration of the surface as the input; or state "
            "the motion of the surface as a function of time, and fit its amplitude "
            "and phase."
        )


def refuse_repeated(parameters) -> None:
    names = [parameter.name for parameter in parameters]
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise ValueError(
            f"Two parameters are called {min(repeated)!r}; rename one of them."
        )


def parameter_places(model: Model, parameters) -> tuple[int, ...]:
    """Return the index of each parameter among the leaves of a model, for a `Layout`.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Args:
        model: The model.
        parameters: The parameters.

    Returns:
        One index per parameter.

    Raises:
        ValueError: A parameter is not a single number of the model, or it is the same
            number as another parameter.

    Examples:
        >>> from jaxcam.fitting.engine import parameter_places
        >>> (place,) = parameter_places(model, [gravity])
        >>> float(jax.tree.leaves(model)[place])
        9.81
    """
    leaves, tree = jax.tree.flatten(model)
    numbered = jax.tree.unflatten(tree, list(range(len(leaves))))
    places = []
    for parameter in parameters:
        place = parameter.where(numbered)
        if not isinstance(place, int) or np.shape(leaves[place]) != ():
            raise ValueError(
                f"The parameter {parameter.name!r} is not a single number of the "
                f"model; let `where` select a field that is a single number."
            )
        if place in places:
            other = parameters[places.index(place)].name
            raise ValueError(
                f"The parameters {other!r} and {parameter.name!r} are the same number; "
                f"omit one of them."
            )
        places.append(place)
    return tuple(places)
