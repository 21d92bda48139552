"""The flow and its Jacobian by the LLVM backend."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.hybrid import flow, Settings
from jaxcam.hybrid._event_counts import EventCounts, EventOrder
from jaxcam.hybrid.codes import RESULTS, RowKind
from jaxcam.hybrid.flow_jacobian import flow_jacobian
from jaxcam.models import BeltOscillator, ImpactOscillator, TwoSidedStop


SETTINGS = Settings(tolerance=1e-12)
IMPACTS = ImpactOscillator(omega=2.8, restitution=0.8, wall=0.0)
STICKS = ImpactOscillator(omega=0.7, restitution=0.3, wall=0.0)


def _setup(given, y):
    """The motion from y = (state, start, end, parameter)."""
    system, name = given
    n = y.shape[0] - 3
    return _with(system, name, y[-1]), y[:n], y[n], y[n + 1]


def _with(system, name, value):
    return type(system)(**{**vars(system), name: value})


CASES = {
    # impacts only, contact, sliding on a surface, and two gaps
    "impacts": (IMPACTS, "wall", [-0.8, 1.0], 9.0),
    "contact": (STICKS, "omega", [-0.8, 1.0], 20.0),
    "contact at the end": (STICKS, "omega", [-0.8, 1.0], 15.0),
    "sliding": (BeltOscillator(), "belt", [0.4, 0.0], 12.0),
    "two gaps": (TwoSidedStop(), "restitution", [0.02, 0.2], 4.0),
}


@pytest.mark.parametrize("name", CASES)
def test_the_jacobian_is_that_of_differences(name):
    """Central differences of the flow, to 1e-6 of the largest derivative."""
    system, parameter, state, end = CASES[name]
    y = np.array([*state, 0.1, end, float(getattr(system, parameter))])
    arrival, matrix = flow_jacobian(_setup, (system, parameter), y, SETTINGS)

    def state_at(y):
        moved, x, t0, t1 = _setup((system, parameter), jnp.asarray(y))
        return np.asarray(flow(moved, x, t0, t1, settings=SETTINGS).state)

    np.testing.assert_allclose(arrival.state, state_at(y), atol=1e-10)
    nudges = 1e-6 * np.eye(len(y))
    moves = [(state_at(y + d) - state_at(y - d)) / 2e-6 for d in nudges]
    expected = np.stack(moves, axis=1)
    np.testing.assert_allclose(matrix, expected, atol=1e-6 * np.max(np.abs(expected)))


def test_the_jacobian_is_that_of_jax():
    """Forward derivatives through XLA, to 1e-11."""
    y = jnp.array([-0.8, 1.0, 0.1, 9.0, 0.0])

    def state_at(y):
        moved, *rest = _setup((IMPACTS, "wall"), y)
        return flow(moved, *rest, settings=SETTINGS).state

    _, matrix = flow_jacobian(_setup, (IMPACTS, "wall"), y, SETTINGS)
    np.testing.assert_allclose(matrix, jax.jit(jax.jacfwd(state_at))(y), atol=1e-11)


def test_a_flow_by_llvm_is_that_of_xla():
    """State to 1e-12; events, contact, mode and code are the same."""
    for end, code in ((15.0, RESULTS.successful), (-1.0, RESULTS.backward)):
        made, expected = (
            flow(STICKS, [-0.8, 1.0], 0.0, end, settings=Settings(backend=backend))
            for backend in ("llvm", "xla")
        )
        np.testing.assert_allclose(made.state, expected.state, atol=1e-12)
        assert RESULTS[made.code] == RESULTS[code]
        both = (
            jax.tree.leaves((one.contact, one.impacts, one.code, one.events, one.start))
            for one in (made, expected)
        )
        for one, other in zip(*both, strict=True):
            np.testing.assert_array_equal(one, other)


def test_events_are_counted_as_one_by_one():
    """The counts of 200 random sequences of 40 attempts are exact."""
    rng = np.random.default_rng(0)
    for kinds in rng.integers(0, len(RowKind), (200, 40)):
        counts, events = np.zeros(5), []
        places = rng.integers(0, 3, len(kinds))
        for kind, place in zip(kinds, places, strict=True):
            if kind == RowKind.LAST_IMPACT:
                events = events[: len(events) - int(counts[-1])]
            if kind not in (RowKind.NOTHING, RowKind.STEP, RowKind.STOP):
                events.append(place)
            counts = _after(counts, kind)
        made = EventCounts.of(kinds.astype(float), places.astype(float))
        found = made.impacts, made.contacts, made.crossings, made.slides, made.recent
        np.testing.assert_array_equal(np.array(found), counts)
        exchanges = sum(a > b for i, b in enumerate(events) for a in events[:i])
        assert float(made.order) == (-1.0) ** exchanges


def test_the_order_of_events_is_found_one_by_one():
    """As from the complete sequence, also with completed chatter sequences."""
    rng = np.random.default_rng(1)
    for kinds in rng.integers(0, len(RowKind), (10, 25)):
        places = rng.integers(0, 3, len(kinds)).astype(float)
        order = EventOrder.zero(3)
        for kind, place in zip(kinds.astype(float), places, strict=True):
            order = order.after(jnp.asarray(kind), jnp.asarray(place))
        made = EventCounts.of(kinds.astype(float), places)
        assert float(order.sign) == float(made.order)


def _after(counts, kind):
    """The rule of `EventCounts`, in plain numbers."""
    impacts, contacts, crossings, slides, recent = counts
    if kind in (RowKind.NOTHING, RowKind.STEP, RowKind.STOP):
        return counts
    if kind == RowKind.IMPACT:
        return np.array([impacts + 1, contacts, crossings, slides, recent + 1])
    if kind == RowKind.LAST_IMPACT:
        impacts, contacts = impacts - recent, contacts + 1
    crossings += kind == RowKind.SWITCH
    slides += kind == RowKind.SLIDE
    return np.array([impacts, contacts, crossings, slides, 0])
