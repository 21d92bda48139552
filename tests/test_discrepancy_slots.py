"""Slots for free functions in a problem."""

import jax
import jax.numpy as jnp
import numpy as np
from swing_rig import PARAMETERS, Swing

from jaxcam.discrepancy.search import Free, Roughness
from jaxcam.discrepancy.search._of_base import within
from jaxcam.discrepancy.search._slots import filled, roomy
from jaxcam.discrepancy.terms import Family, Variable, Where, WithTerms
from jaxcam.fitting import Model, Problem, Sensor
from jaxcam.fitting.engine import _linearise, free_columns, Point
from jaxcam.fitting.engine._seen_directly import seen_directly
from jaxcam.recordings import Recording, segment


def test_only_functions_of_the_sensor_affect_samples_directly():
    """A force acts through the motion, so samples do not depend on its coefficients at
    a given motion; the shorter linearisation that this permits is the complete one, to
    1e-9 of its size."""
    time = 1e-3 * np.arange(500)
    seen = 0.2 * np.cos(12 * time) + 1e-5 * np.random.default_rng(4).normal(size=500)
    run = Recording("run", time, {"angle_rad": seen})
    model = Model(WithTerms(Swing(damping=0.2)), {"angle_rad": Sensor(0, noise=1e-5)})
    problem = Problem.build(
        model,
        [segment(run, "angle_rad", noise=1e-5)],
        [within(one) for one in PARAMETERS],
    )
    family = Family(Where.FLIGHT, Variable.POSITION, -0.2, 0.2)
    room = filled(
        roomy(problem, family, (), None), [Free(family, Roughness(), "force_a")]
    )
    direct = {
        name.rpartition("_")[0]
        for name, shown in zip(room.names, seen_directly(room.layout, room.pieces))
        if shown
    }
    assert direct == {"sensor_a"}
    rng = np.random.default_rng(2)
    values = np.array(room.start.values)
    force = [k for k, name in enumerate(room.names) if name.startswith("force_a")]
    values[:, force] = rng.normal(size=len(force))
    point = Point(jnp.asarray(values), room.start.states)
    free = [*(one.name for one in PARAMETERS), *(room.names[k] for k in force)]
    columns = free_columns(room, free)
    local, scales = jnp.asarray(columns.local[0]), jnp.asarray(columns.scales[0])
    near = room.layout.about(point.values[0])
    first = jax.tree.map(lambda a: a[0], (room.pieces, room.extras, point.states))
    short, complete = (
        _linearise.assemble_one(near, *first, local, scales, shown)[0]
        for shown in (False, True)
    )
    for one, other in zip(short, complete):
        np.testing.assert_allclose(
            one, other, rtol=0, atol=1e-9 * float(np.max(np.abs(other)))
        )
