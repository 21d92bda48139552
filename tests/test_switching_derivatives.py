"""Derivatives through crossings: saltation products, and central differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from switched_systems import Affine, random_affine

import jaxcam
from jaxcam.hybrid import flow, Settings
from variational import switching_saltation


SHARP = Settings(tolerance=1e-13)
END = 4.0


@jax.jit
def _end(system, state):
    return flow(system, state, 0.0, END, settings=SHARP).state


_slopes = jax.jit(jax.jacfwd(_end, argnums=(0, 1)))


def _product(system: Affine, state):
    """Exponentials of the branches and saltation matrices of the crossings."""
    run = jaxcam.simulate(system, state, 0.0, END, settings=SHARP)
    assert run.successful
    sides = np.array(run.steps.sides[0])
    times = np.append(np.asarray(run.switches.time), END)
    product, t = np.eye(3), 0.0
    for k, time in enumerate(times):
        on = np.where(sides > 0, 1.0, 0.0)
        branch = np.asarray(system.matrix) + np.tensordot(on, system.jumps, 1)
        product, t = expm(branch * (time - t)) @ product, time
        if k + 1 < len(times):
            surface = int(run.switches.surface[k])
            x = run.switches.before[k]
            matrix = switching_saltation(system, time, x, jnp.asarray(sides), surface)
            product = np.asarray(matrix) @ product
            sides[surface] *= -1
    return product, len(times) - 1


@pytest.mark.slow
def test_flow_has_the_saltation_matrix_of_each_crossing():
    """Fields that jump, and relays with hysteresis."""
    rng, crossings, found = np.random.default_rng(4), 0, 0
    while found < 8:
        width = 0.1 * (found % 2)
        system = random_affine(rng, jump=0.3, width=width)
        state = jnp.asarray(rng.normal(size=3))
        run = jaxcam.simulate(system, state, 0.0, END, settings=SHARP)
        slides = np.any(np.asarray(run.switches.kind)[: int(run.switches.count)] != 0)
        if not run.successful or slides:
            continue
        product, count = _product(system, state)
        by_system, by_state = _slopes(system, state)
        size = np.max(np.abs(product))
        assert np.max(np.abs(by_state - product)) < 1e-9 * size
        crossings, found = crossings + count, found + 1
        # thresholds: by central differences
        if count:
            _compare(system, state, by_system, by_state)
    assert crossings > 10


def _compare(system, state, by_system, by_state):
    step, units = 1e-5, np.eye(3)

    def difference(one, other):
        return np.asarray(_end(*one) - _end(*other)) / (2 * step)

    for i in range(3):
        found = difference(
            (system, state + step * units[i]), (system, state - step * units[i])
        )
        assert np.max(np.abs(found - by_state[:, i])) < 1e-6 * (
            1 + np.max(np.abs(found))
        )
    for i in range(2):
        moved = [Affine(*(_at_level(system, i, s * step))) for s in (1.0, -1.0)]
        found = difference((moved[0], state), (moved[1], state))
        slope = by_system.levels[:, i]
        assert np.max(np.abs(found - slope)) < 1e-6 * (1 + np.max(np.abs(found)))


def _at_level(system, i, by):
    *rest, levels, width = jax.tree.leaves(system)
    return (*rest, levels.at[i].add(by), width)
