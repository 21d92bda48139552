"""What a vibration would gain, at each frequency: against fits and against chance."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcam import HybridSystem
from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.search import (
    added_gain,
    blocks_of,
    extended,
    force_blocks,
    newton_step,
)
from jaxcam.discrepancy.search._hidden_kinds import RELAXATION, RESONANCE
from jaxcam.discrepancy.search._hidden_scan import _Chain
from jaxcam.discrepancy.search._hidden_signals import driven_by
from jaxcam.discrepancy.search._hidden_state import Hidden, with_hidden
from jaxcam.discrepancy.search._local_force import force_response
from jaxcam.discrepancy.search._state_elimination import StateElimination
from jaxcam.discrepancy.search._vibration_scan import Periodogram, periodogram
from jaxcam.discrepancy.terms import HiddenForce, WithTerms
from jaxcam.discrepancy.terms._library import ExternalVibration
from jaxcam.discrepancy.terms._shapes import ForceOfTime, ForceOfVelocity
from jaxcam.fitting import fit, Model, Parameter, Problem, Sensor
from jaxcam.recordings import Recording, segment


_NOISE, _STIFFNESS, _BOUNCE = 1e-4, 150.0, 0.9
_TIME = 1e-3 * np.arange(3000)


class Bouncer(HybridSystem):
    """A mass that a preloaded spring pulls onto a stop at zero."""

    stiffness: float = _STIFFNESS
    bounce: float = _BOUNCE

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.stiffness * (state[0] + 0.2)])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return state * jnp.stack([jnp.ones_like(t), -self.bounce])


def _motion(amplitude, frequency, height):
    """Flight after flight by scipy, until the record ends or the bounces are small."""
    w = 2 * np.pi * frequency
    values, t, x = np.zeros(len(_TIME)), 0.0, np.array([height, 0.0])

    def field(t, x):
        return [x[1], -_STIFFNESS * (x[0] + 0.2) + amplitude * np.sin(w * t + 0.4)]

    def hit(t, x):
        return x[0]

    hit.terminal, hit.direction = True, -1  # pyright: ignore
    while t < _TIME[-1]:
        inside = _TIME[(_TIME >= t) & (_TIME <= _TIME[-1])]
        span = (t, _TIME[-1] + 1e-9)
        flight = solve_ivp(
            field, span, x, "DOP853", None, True, hit, rtol=1e-10, atol=1e-12
        )
        end = flight.t[-1]
        inside = inside[inside <= end]
        values[np.searchsorted(_TIME, inside)] = flight.sol(inside)[0]
        if not len(flight.t_events[0]):
            break
        t, x = end, np.array([0.0, -_BOUNCE * flight.y[1, -1]])
    return values


@pytest.fixture(scope="module")
def build():
    model = Model(
        WithTerms(Bouncer(), (ExternalVibration(),)),
        {"height_m": Sensor(0, noise=_NOISE)},
    )
    parameters = [
        Parameter("stiffness", lambda m: m.system.base.stiffness, tolerance=3.0),
        *ExternalVibration().parameters(0),
    ]

    def problem(amplitude, frequency, seed):
        rng = np.random.default_rng(seed)
        parts = []
        for number, height in enumerate((0.4, 0.55)):
            motion = _motion(amplitude, frequency, height)
            noisy = motion + _NOISE * rng.standard_normal(len(motion))
            run = Recording(f"run{number}", _TIME, {"height_m": noisy})
            floor = np.zeros(len(_TIME))
            parts.append(
                segment(run, "height_m", floor, noise=_NOISE, restitution=_BOUNCE)
            )
        return Problem.build(model, parts, parameters)

    return problem


def _scan(problem, found):
    return periodogram(
        problem, force_response(problem, found.point, found.free), Policy()
    )


def test_the_scan_promises_what_a_fit_gains(build):
    """The frequency to a quarter of a cell; the gain to 3 %, far above its rivals."""
    problem = build(0.15, 23.3, 1)
    textbook = fit(problem, free=["stiffness"])
    scan = _scan(problem, textbook)
    frequency, grown = scan.best
    assert frequency == pytest.approx(23.3, abs=0.25 / _TIME[-1])
    values = np.array(textbook.point.values)
    values[:, problem.names.index("fe")] = frequency
    shaken = fit(
        problem,
        free=["stiffness", "ext_sin", "ext_cos"],
        start=textbook.point._replace(values=jnp.asarray(values)),
    )
    assert textbook.cost - shaken.cost == pytest.approx(grown, rel=0.03)
    # the samples alone show a sine of this size over white noise less well
    seen = 2 * len(_TIME) * (0.15 / (2 * np.pi * 23.3) ** 2 / _NOISE) ** 2 / 2
    assert grown > 3 * seen
    assert scan.best_separate[1] >= grown - 1e-6


def test_gains_without_vibration_are_within_chance(build):
    """At most chi-square of two, and no peak of one in a thousand.

    Less than two on average: impacts are trusted less than they deserve here.
    """
    problem = build(0.0, 23.3, 2)
    textbook = fit(problem, free=["stiffness"])
    scan = _scan(problem, textbook)
    assert 0.4 < np.mean(scan.gain) < 2.2
    assert 0.8 < np.mean(scan.separate) < 4.4
    assert scan.best[1] < 2 * np.log(len(scan.frequency) / 1e-3)


def test_forces_at_nodes_say_what_terms_in_the_system_say(build):
    """Score and information of two shapes of force, to 3e-3 of their size.

    Between nodes a force is linear. What is left grows with the noise, which puts the
    ends of flights a little aside: 1.5e-3 at this noise, 0.6e-3 at a tenth of it.
    """
    problem = build(0.15, 23.3, 1)
    found = fit(problem, free=["stiffness"])
    shapes = (
        ForceOfVelocity([0.0, 0.0], -3.0, 3.0),
        ForceOfTime([0.0, 0.0], 0.0, 3.0),
    )
    response = force_response(problem, found.point, found.free)
    quick = force_blocks(problem, response, shapes)
    wide = extended(problem, shapes, found.point)
    names = (*found.free, *quick.names[1:])
    exact = blocks_of(wide, found.point._replace(values=wide.start.values), 1, names)
    assert quick.names == exact.names
    for mine, theirs in zip(quick.total(), exact.total()):
        size = np.sqrt(np.diag(exact.total()[0]))
        size = size if theirs.ndim == 1 else np.outer(size, size)
        assert np.max(np.abs(mine - theirs) / size) < 3e-3 * (
            np.max(np.abs(theirs) / size)
        )


@pytest.mark.xfail(
    strict=True, reason="promises are 3 and 7 % too large, strengths a third off: open"
)
@pytest.mark.parametrize(
    ("kind", "numbers"), [(RELAXATION, (0.05,)), (RESONANCE, (6.1, 0.08))]
)
def test_the_scan_of_hidden_elements_promises_what_parameters_gain(
    build, kind, numbers
):
    """Outputs, free motions of each record and parts by the motion: to 1 %."""
    problem = build(0.15, 23.3, 1)
    found = fit(problem, free=["stiffness"])
    driven = driven_by(problem)
    assert driven is not None
    response = force_response(problem, found.point, found.free)
    chain = _Chain(problem, response, driven)
    (promised,), ((strengths, starts, direct),) = chain.gains(kind, [numbers])
    # the same as parameters of the system, with free motions of which nothing is known
    room = HiddenForce.empty(*driven.position.shape)
    hidden = Hidden(
        kind, driven, numbers, (1e6,) * len(kind.outputs), np.zeros((2, kind.starts))
    )
    wide = extended(problem, [room], found.point)
    filled = with_hidden(wide, hidden)
    names = [*hidden.outputs, *hidden.free_motions, *hidden.direct_parts]
    blocks = blocks_of(filled, wide.start, 1, [*found.free, *names])
    information, score = blocks.total()
    free, new = blocks.rows(found.free), blocks.rows(names)
    gained = added_gain(information, score, free, new, 1e-12)
    assert gained > 10
    assert promised == pytest.approx(gained, rel=0.01)
    both = np.union1d(free, new)
    step = newton_step(information, score, both)[0] * blocks.scale[both]
    labels = np.array(blocks.names)[both]
    for values, own in (
        (strengths, hidden.outputs),
        (direct, hidden.direct_parts),
        (np.asarray(starts).T.ravel(), hidden.free_motions),
    ):
        expected = np.concatenate([step[labels == name] for name in own])
        np.testing.assert_allclose(values, expected, rtol=0.05)


def test_states_are_eliminated_as_from_the_whole_matrix():
    """Two pieces of two states, three parameters and a force, tied by four rows."""
    rng = np.random.default_rng(5)
    n, m, f, rows = 2, 3, 1, 4
    known = np.zeros((m + f, m + f + 1))
    whole = np.zeros((2 * n + m + f, 2 * n + m + f + 1))

    def add(direct, pushed, off, sign):
        moved = np.concatenate([direct, pushed], axis=1)
        known[...] += sign * moved.T @ np.column_stack([moved, off])

    states = StateElimination(add)
    rest = slice(2 * n, None)
    for k in range(2):
        # rows of the piece itself: its state, parameters and force, and what is off
        own, off = rng.normal(size=(9, n + m + f)), rng.normal(size=9)
        place = np.r_[k * n : (k + 1) * n, 2 * n : 2 * n + m + f]
        square = own.T @ np.column_stack([own, off])
        whole[np.ix_(place, [*place, -1])] += square
        known += square[n:, n:]
        blocks = [
            square[:n, :n], square[:n, n : n + m], square[:n, -1],
            square[:n, n + m : -1],
        ]  # fmt: skip
        if k == 0:
            states.begin(blocks)
        else:
            tie, off = rng.normal(size=(rows, 2 * n + m + f)), rng.normal(size=rows)
            whole += tie.T @ np.column_stack([tie, off])
            direct, pushed = tie[:, 2 * n : 2 * n + m], tie[:, 2 * n + m :]
            states.follow(blocks, tie[:, :n], tie[:, n : 2 * n], (direct, off, pushed))
    states.end()
    inner, side = whole[: 2 * n, : 2 * n], whole[: 2 * n, rest]
    left = whole[rest, rest] - side[:, :-1].T @ np.linalg.solve(inner, side)
    assert known == pytest.approx(left, rel=1e-9, abs=1e-9)


def test_a_gain_that_falls_from_the_lowest_frequency_is_no_peak():
    """Of a slow change and a weaker vibration, the vibration is the peak, and so is a
    vibration at the lowest frequency.
    """
    frequency = np.arange(1.0, 7.0)
    falling = np.array([9.0, 7.0, 3.0, 2.0, 5.0, 4.0])
    scan = Periodogram(frequency, falling, falling[::-1], 2, lowest=2.0)
    assert scan.best == (5.0, 5.0)
    assert scan.best_separate == (6.0, 9.0)
    edge = np.array([3.0, 7.0, 3.0, 2.0, 1.0, 0.5])
    alone = Periodogram(frequency, edge, np.sort(falling)[::-1], 2, lowest=2.0)
    assert alone.best == (2.0, 7.0)
    assert alone.best_separate == (6.0, 0.0)
