"""Basins of impacting systems: coexistence, and what they must not depend on."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.hybrid import stroboscope
from jaxcam.models import (
    DryFrictionOscillator,
    ImpactOscillator,
    preset,
    rpm_to_rad_s,
)
from jaxcam.sweeps import (
    basins,
    chart,
    follow_basins,
    Grid,
    ImpactSection,
    largest_exponents,
    load_sweep,
    Map,
    Stroboscopic,
)
from jaxcam.sweeps._basins_job import default_scale
from jaxcam.sweeps.attractors import match_orbits
from jaxcam.sweeps.attractors._attractors import find_attractors
from jaxcam.sweeps.attractors._fingerprint import cell_codes, fingerprints
from jaxcam.sweeps.attractors._label import label_names
from jaxcam.sweeps.attractors._settle import settle


OSCILLATOR = ImpactOscillator(omega=2.6, restitution=0.8, wall=0.0)
#: one program for nearly all of these tests
SECTION = Stroboscopic(OSCILLATOR, lanes=16)
#: its last row is behind the wall
GRID = Grid((-1, -2), (0.2, 2), (6, 10))
OPTIONS = {"turns": 200, "reruns": 5}


@pytest.fixture(scope="module")
def coexisting():
    return basins(SECTION, GRID, **OPTIONS)


def test_two_attractors_coexist(coexisting):
    """P(1,1), the closed form of it, and P(6,6); nothing else is left after a while."""
    assert coexisting.names == ["P(1,1)", "P(6,6)"]
    assert np.array_equal(coexisting.attractor[-1], np.full(10, -3))
    shares = coexisting.shares
    assert sum(s.share for s in shares.values()) == pytest.approx(1)
    assert shares["P(1,1)"].share == pytest.approx(0.34, abs=0.2)
    orbit = coexisting.orbits[1]
    assert np.isfinite(orbit).all(axis=1).sum() == 6
    # one turn leads from each point of it to the next one
    moved = SECTION.sample(orbit[:6], 1, 1).final
    assert np.abs(moved - np.roll(orbit[:6], -1, axis=0)).max() < 1e-6


def test_a_system_without_constraints_has_basins():
    """A dry-friction oscillator has no gaps; all states reach its one orbit."""
    oscillator = DryFrictionOscillator(omega=0.5, friction=0.6)
    found = basins(oscillator, Grid((-2, -2), (2, 2), (4, 4)), turns=100)
    assert found.names == ["P(0,1)"]
    assert np.array_equal(found.attractor, np.zeros((4, 4)))


def test_p11_is_the_orbit_in_closed_form(coexisting):
    """At wall 0: x = gamma cos(wt + phi) + A sin(t), zero at both ends of a period.

    With the impact at time zero, x(0) = x(T) = 0 and v(0) = -r v(T), solved for phase
    and amplitude by hand: a linear system for each phase.
    """
    w, r = 2.6, 0.8
    period, gamma = 2 * np.pi / w, 1 / (1 - w * w)
    # x = gamma cos(w t + phi) + a cos t + b sin t
    c, s = np.cos(period), np.sin(period)

    def unknowns(phi):
        a = -gamma * np.cos(phi)
        b = a * (1 - c) / s
        before = -gamma * w * np.sin(phi) - a * s + b * c
        after = -gamma * w * np.sin(phi) + b
        return a, b, after + r * before

    phases = np.linspace(0, 2 * np.pi, 20001)
    value = np.array([unknowns(phi)[2] for phi in phases])
    change = np.nonzero(np.diff(np.sign(value)))[0]
    found = []
    for k in change:
        share = value[k] / (value[k] - value[k + 1])
        phi = phases[k] + share * (phases[k + 1] - phases[k])
        a, b, _ = unknowns(phi)
        # forcing phase zero is where w t + phi is a multiple of 2 pi
        t = np.mod(-phi, 2 * np.pi) / w
        x = gamma + a * np.cos(t) + b * np.sin(t)
        found.append([x, -a * np.sin(t) + b * np.cos(t)])
    here = coexisting.orbits[0, 0]
    assert np.abs(np.array(found) - here).max(axis=1).min() < 1e-6


def test_labels_do_not_depend_on_order_or_blocks(coexisting):
    """States in any order, in lanes of any number, in blocks of any size."""
    rng = np.random.default_rng(0)
    states = GRID.states()
    order = rng.permutation(len(states))
    samples, labels = settle(SECTION, states[order], 200, 24, reruns=5)
    origin, scale = np.array(GRID.low), default_scale(SECTION, GRID, 200, 24)
    prints = fingerprints(samples.states, labels.turns, origin, scale)
    (odd,) = np.nonzero(labels.turns == 0)
    cells = cell_codes(samples.states[odd], origin, scale, 1 / 64)
    number, _ = find_attractors(
        *labels, prints, [(odd, cells)], states[order], same=1e-3
    )
    assert np.array_equal(number, coexisting.attractor.ravel()[order])
    for block, workers in ((5, 2), (1, 1)):
        found = basins(SECTION, GRID, **OPTIONS, block=block, workers=workers)
        assert np.array_equal(found.attractor, coexisting.attractor)
        assert np.array_equal(found.orbits, coexisting.orbits, equal_nan=True)


def test_a_component_with_a_single_cell_has_the_scale_of_the_motion():
    """A rotation takes x to y / 100, but the only cell of y is 0.001 wide. A motion
    that diverges has no size, and neither has one without samples to compare.
    """

    def rotated(x, p):
        return jnp.stack([100.0 * x[1], -x[0] / 100.0])

    def growing(x, p):
        return jnp.stack([0.5 * x[0], 1.2 * x[1] + 1.0])

    one, two = (Grid((-1.0, 0.0), (3.0, 1e-3), (4, count)) for count in (1, 2))
    section = Map(rotated, None)
    # the largest value of y is 0.025, and 2^-5 the nearest power of two
    assert default_scale(section, one, 1, 8).tolist() == [4.0, 2.0**-5]
    assert default_scale(section, two, 1, 8).tolist() == [4.0, 1e-3]
    assert default_scale(section, one, 1, 1).tolist() == [4.0, 1e-3]
    assert default_scale(Map(growing, None), one, 20, 8).tolist() == [4.0, 1e-3]


def test_lanes_advance_alike_in_any_company():
    """The same bits alone, among few and among many."""
    states = np.tile(GRID.states()[:32], (2, 1)) + np.arange(64)[:, None] * 1e-3
    states[:, 0] -= 0.1
    many = Stroboscopic(OSCILLATOR, lanes=64).sample(states, 64, 8).states
    few = SECTION.sample(states[::-1], 64, 8).states
    assert np.array_equal(many, few[::-1], equal_nan=True)


def test_shares_are_stable_under_refinement(coexisting):
    """Twice as fine: within three standard errors."""
    finer = basins(SECTION, Grid((-1, -2), (0, 2), (10, 20)), **OPTIONS)
    assert finer.names == coexisting.names
    one, other = coexisting.shares["P(6,6)"], finer.shares["P(6,6)"]
    assert abs(one.share - other.share) < 3 * np.hypot(one.stderr, other.stderr)


def test_an_attractor_keeps_its_number_where_others_are_absent(coexisting):
    """Zooming into the basin of P(6,6), which has number 1 in the whole picture."""
    number = coexisting.attractor
    i, j = np.argwhere(number == 1)[0]
    centre = np.array([GRID.centres(0)[i], GRID.centres(1)[j]])
    tiny = Grid(centre - 1e-9, centre + 1e-9, (2, 2))
    alone = basins(SECTION, tiny, **OPTIONS)
    assert alone.names == ["P(6,6)"] and np.all(alone.attractor == 0)
    known = basins(SECTION, tiny, **OPTIONS, known=coexisting)
    assert known.names == coexisting.names and np.all(known.attractor == 1)
    pairs = match_orbits(coexisting.orbits, alone.orbits, coexisting.scale, 0.2)
    assert pairs == {0: 1}


def test_attractors_are_matched_along_a_parameter(tmp_path):
    """P(6,6) is gone after a while; P(1,1) is followed through its flip."""
    grid = Grid((-1, -2), (0, 2), (6, 8))
    found = follow_basins(
        SECTION, "omega", [2.6, 2.61, 2.66], grid, 800, reruns=4, keep=48, out=tmp_path
    )
    first = found.names[:, 0]
    assert first.tolist() == ["P(1,1)", "P(1,1)", "P(2,2)"]
    assert found.shares[:, 0] == pytest.approx(
        [b.shares[str(name)].share for b, name in zip(found.basins, first, strict=True)]
    )
    assert found.names[0, 1] == "P(6,6)" and found.shares[2, 1] == 0
    assert load_sweep(tmp_path / "0001").names == found.basins[1].names


def test_an_attractor_that_vanished_is_not_matched_with_a_later_one():
    """An orbit of period two is there, is not, and is there again."""
    cubic = Map(lambda x, p: p["a"] * x - 0.5 * x**3, {"a": 2.2})
    grid = Grid([-1.0], [1.0], [10])
    found = follow_basins(cubic, "a", [2.2, 0.5, 2.2], grid, most=0.5)
    assert np.all(found.shares[1] * found.shares[0] == 0)
    assert np.all(found.shares[2] * found.shares[0] == 0)
    np.testing.assert_allclose(found.shares.sum(axis=1), 1.0)


def test_nobody_can_start():
    with pytest.raises(ValueError, match="violate gap >= 0"):
        basins(SECTION, Grid((0.5, 0), (1, 1), (2, 2)), 20, keep=4)


def test_charts_and_basins_need_one_sample_per_period():
    section = ImpactSection(OSCILLATOR)
    with pytest.raises(ValueError, match="a chart needs .* ImpactSection is not; pass"):
        chart(section, ("omega", "restitution"), [2.6], [0.8], [-0.66, 0.02])
    with pytest.raises(ValueError, match="basins need .* ImpactSection is not; pass"):
        basins(section, GRID, 40)


@pytest.mark.slow
def test_chart_of_two_parameters():
    """P(1,1) at its own parameters; the label of a pair is that of the single run."""
    omega, r = np.array([2.6, 2.7, 2.8]), np.array([0.7, 0.8])
    where = ("omega", "restitution")
    found = chart(SECTION, where, omega, r, [-0.66, 0.02], turns=400)
    assert found.labels.shape == (2, 3, 1) and found.labels[1, 0, 0] == "P(1,1)"
    assert found.parameters == ("omega", "restitution")
    for (j, i), word in np.ndenumerate(found.labels[..., 0]):
        own = Stroboscopic(ImpactOscillator(omega[i], r[j], 0.0), lanes=16)
        _, labels = settle(own, np.tile([-0.66, 0.02], (16, 1)), 400, 32)
        assert label_names(labels)[0] == word


@pytest.mark.slow
def test_exponents_tell_chaos_from_orbits():
    """Each impact multiplies areas by r^2, nothing else does: P(1,1) has a pair of
    complex multipliers of magnitude r, so both exponents are ln(r) / period."""
    omega, r = np.array([2.6, 2.8]), np.array([0.7, 0.8])
    found = chart(
        SECTION, ("omega", "restitution"), omega, r, [-0.66, 0.02],
        turns=400, exponents=400,
    )  # fmt: skip
    assert found.labels[1, 0, 0] == "P(1,1)" and found.labels[0, 1, 0] == "chaotic"
    exponent = found.dataset["exponent"].values
    assert np.all(exponent[found.dataset["turns"].values > 0] < 0)
    both = largest_exponents(SECTION, [[-0.66, 0.02]], 400)
    assert not both.chaotic[0]
    assert both.largest[0] == pytest.approx(np.log(0.8) * 2.6 / (2 * np.pi), rel=0.05)


def test_no_trajectories_give_no_samples():
    """Empty arrays of the shapes that `Stroboscope` documents."""
    none = stroboscope(OSCILLATOR, np.zeros((0, 2)), 12, skip=7)
    assert none.states.shape == (0, 5, 2)
    assert none.hits.shape == none.rests.shape == (0, 5)
    assert none.code.shape == none.impacts.shape == none.steps.shape == (0,)


def test_skipped_turns_change_nothing():
    states = GRID.states()[:16]
    whole = stroboscope(OSCILLATOR, states, 12, block=16, rows=128)
    part = stroboscope(OSCILLATOR, states, 12, skip=7, block=16, rows=128)
    for name in ("states", "hits", "rests"):
        one, other = getattr(whole, name)[:, 7:], getattr(part, name)
        assert np.array_equal(one, other)
    assert np.array_equal(whole.hits.sum(axis=1), whole.impacts)
    with pytest.raises(ValueError, match="skip is 12"):
        stroboscope(OSCILLATOR, states, 12, skip=12)


#: speed (rpm), printed start, and the attractor that the thesis names for it
PRINTED = {
    "A": (145.0, (0.42092, 1.84), "P(1,1)"),
    "B": (145.0, (0.33704, 0.13333), "P(inf,1)"),
    "C": (152.3, (0.33704, 0.24), "P(inf,1)"),
    "D1": (152.3, (0.37253, 1.7867), "P(2,2)"),
    "D2": (152.3, (0.430593, 1.9466), "P(2,2)"),
    "E": (154.2, (0.36365, 0.008), "aperiodic"),
    "F1": (154.2, (0.34623, 1.704), "P(2,2)"),
    "G1": (156.0, (0.33268, 1.656), "P(2,2)"),
    "H1": (156.0, (0.4226893, -2.552), "P(6,6)"),
}


@pytest.mark.slow
def test_printed_starts_end_where_the_thesis_says():
    """Figures 5.14, 5.16, 5.18 and 5.20, with the calibrated rig."""
    rpm, states, words = zip(*PRINTED.values(), strict=True)
    section = Stroboscopic(preset("calibrated"))
    _, labels = settle(
        section,
        np.array(states),
        1200,
        64,
        where=lambda s: s.speed,
        values=rpm_to_rad_s(np.array(rpm)),
    )
    assert label_names(labels).tolist() == list(words)


@pytest.mark.slow
def test_basins_of_the_rig_at_145_rpm():
    """Figure 5.14, small: P(inf,1) and P(1,1), low starts belong to the former."""
    speed = jnp.asarray(rpm_to_rad_s(145.0))
    system = eqx.tree_at(lambda s: s.speed, preset("calibrated"), speed)
    found = basins(system, Grid((0.335, -3), (0.55, 3), (24, 24)), 60)
    assert found.names == ["P(inf,1)", "P(1,1)"]
    assert found.shares["P(1,1)"].share == pytest.approx(0.344, abs=0.05)
    assert np.all(found.attractor[0, 10:15] == 0)
