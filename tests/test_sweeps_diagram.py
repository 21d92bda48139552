"""Bifurcation diagrams of impacting systems."""

import numpy as np
import pytest

import jaxcam
from jaxcam.models import ImpactOscillator, preset, rad_s_to_rpm, rpm_to_rad_s
from jaxcam.sweeps import (
    diagram,
    ImpactSection,
    load_sweep,
    monte_carlo,
    Stroboscopic,
)


OSCILLATOR = ImpactOscillator(omega=2.6, restitution=0.8, wall=0.0)
#: eight motions advance together in all tests but the slow one
SECTION = Stroboscopic(OSCILLATOR, lanes=8)
START = (-0.66, 0.02)


def test_one_direction_is_what_single_runs_say(tmp_path):
    """The samples at one value are those of a trajectory, to 1e-7."""
    values = np.linspace(2.6, 2.7, 8)
    made = diagram(
        SECTION, "omega", values, START, turns=40, keep=10, out=tmp_path / "d"
    )
    assert made.states.shape == (8, 1, 10, 2) and made.parameter == "omega"
    own = ImpactOscillator(omega=values[3], restitution=0.8, wall=0.0)
    run = jaxcam.simulate(own, START, 0.0, 40 * float(own.period))
    wanted = np.asarray(run.stroboscopic())[-10:]
    assert np.abs(made.states[3, 0] - wanted).max() < 1e-7
    assert np.array_equal(load_sweep(tmp_path / "d").states, made.states)


def test_carried_states_start_where_the_last_value_ended():
    """Up and down between two values: the second starts from the end of the first."""
    values = [2.6, 2.62]
    made = diagram(
        SECTION, lambda s: s.omega, values, START, turns=30, keep=5, direction="both"
    )
    assert made.direction.tolist() == [1, 1, -1, -1]
    assert made.values.tolist() == [2.6, 2.62, 2.62, 2.6]
    own = Stroboscopic(ImpactOscillator(omega=2.62, restitution=0.8), lanes=8)
    again = own.sample(made.states[0, :, -1], 30, 5).states
    assert np.array_equal(made.states[1], again)
    # the way down starts from the end of the way up
    down = own.sample(made.states[1, :, -1], 30, 5).states
    assert np.array_equal(made.states[2], down)


def test_seconds_of_a_rig_in_whole_turns(tmp_path):
    """As many turns as fit: 42 and 12 of 2.417 s, 48 and 14 of 2.094 s, bit for bit."""
    values = [2.6, 3.0]
    made = diagram(
        SECTION,
        "omega",
        values,
        START,
        direction="both",
        dwell=(100.0, 30.0),
        out=tmp_path / "d",
    )
    filled = np.isfinite(made.states[:, 0, :, 0]).sum(axis=1)
    assert filled.tolist() == [12, 14, 14, 12]
    first = SECTION.sample(np.array([START]), 54, 12)
    assert np.array_equal(made.states[0, :, :12], first.states)
    own = Stroboscopic(ImpactOscillator(omega=3.0, restitution=0.8), lanes=8)
    then = own.sample(first.final, 62, 14)
    assert np.array_equal(made.states[1], then.states)
    assert made.labels[0, 0] == "P(1,1)"
    with pytest.raises(ValueError, match="different sweep|something else"):
        diagram(
            SECTION,
            "omega",
            values,
            START,
            direction="both",
            dwell=(99.0, 30.0),
            out=tmp_path / "d",
            resume=True,
        )


def test_a_wall_that_moves_takes_the_state_with_it():
    """A state carried behind the wall is put onto it; no motion fails."""
    made = diagram(
        SECTION,
        "wall",
        np.linspace(0.2, -0.4, 4),
        [0.0, 0.0],
        turns=20,
        keep=5,
        direction="down",
    )
    assert np.all(made.dataset["code"].values == 0)
    assert np.all(made.states[..., 0] <= made.values[:, None, None] + 1e-12)


def test_impacts_are_those_of_a_trajectory():
    """Time and rebound of the last impacts, to 1e-7; the phase of P(1,1) repeats."""
    section = ImpactSection(OSCILLATOR, lanes=8)
    made = diagram(section, "omega", [2.6] * 8, START, turns=40, keep=12)
    run = jaxcam.simulate(OSCILLATOR, START, 0.0, 40 * float(OSCILLATOR.period))
    hits = run.impacts
    times = made.dataset["time"].values[0, 0]
    assert np.abs(times - np.asarray(hits.time)[-12:]).max() < 1e-7
    assert np.abs(made.states[0, 0] - np.asarray(hits.after)[-12:]).max() < 1e-7
    phase = made.dataset["phase"].values[0, 0]
    assert np.abs(phase - np.mod(times * 2.6 / (2 * np.pi), 1)).max() < 1e-12


def test_random_starts_show_what_one_start_hides():
    """At 2.6 some of the starts settle on P(1,1), and others do not."""
    states = monte_carlo((-1, -2), (0, 2), 16, points=1)
    made = diagram(SECTION, "omega", [2.6], states, turns=300, keep=24)
    labels = set(made.labels[0])
    assert "P(1,1)" in labels and len(labels) > 1


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"direction": "sideways"}, "each, up, down, both"),
        ({"keep": 50}, "keep is 50 and turns is 40"),
        ({"where": "size"}, "omega, restitution"),
        ({"where": ("omega", "wall")}, "use chart"),
        ({"values": [[2.6, 2.7]]}, "give a vector"),
        ({"values": [np.nan]}, "not finite"),
        ({"states": np.zeros((3, 2, 2))}, "for 2 points"),
        ({"states": (0.5, 0.0)}, "violate gap >= 0"),
        ({"system": 3}, "cannot be swept"),
        ({"period_tolerance": 0.0}, "period_tolerance is 0"),
        ({"block": 0}, "block is 0"),
        ({"workers": 0}, "workers is 0"),
        ({"dwell": (60, 10)}, "choose the direction up"),
        ({"dwell": (60, 2), "direction": "up"}, "record longer"),
        ({"dwell": (-1, 10), "direction": "up"}, "settling time and the recording"),
        (
            {"system": ImpactSection(OSCILLATOR), "dwell": (6, 9), "direction": "up"},
            "once per period",
        ),
    ],
)
@pytest.mark.usefixtures("unchecked_types")
def test_bad_input_is_one_sentence(options, word):
    given = {"system": SECTION, "where": "omega", "values": [2.6, 2.61]}
    given |= {"states": START, "turns": 40, "keep": 10} | options
    with pytest.raises(ValueError, match=word):
        diagram(**given)


def test_a_system_without_a_period_says_so():
    from jaxcam.models import TripleIntegrator

    with pytest.raises(ValueError, match="period"):
        diagram(TripleIntegrator(), "restitution", [0.5], [0.0, 0.1, -2.0])


@pytest.mark.slow
def test_sequence_of_the_rig():
    """Table 5.1, right column, read off a diagram in steps of half a rpm.

    Upwards from rest: contact until detachment at 125.1 rpm, then P(inf,1) until its
    chattering is interrupted at 152.68. Downwards from P(1,1): its flip at 151.8, its
    fold at 135.95, below which motions stick again.
    """
    system = preset("calibrated")
    rpm = np.arange(120, 156.1, 0.5)
    up = diagram(system, "speed", rpm_to_rad_s(rpm), turns=100, keep=24, direction="up")
    down = diagram(
        system,
        "speed",
        rpm_to_rad_s(rpm[(rpm >= 130) & (rpm <= 151)]),
        (0.42, 1.84),
        turns=200,
        keep=24,
        direction="down",
    )
    first, second, third, *_ = [
        (r.label, rad_s_to_rpm(r.low), rad_s_to_rpm(r.high)) for r in up.ranges()
    ]
    assert first == ("contact", pytest.approx(120), pytest.approx(125))
    assert second == ("P(inf,1)", pytest.approx(125.5), pytest.approx(152.5))
    assert third[0] != "P(inf,1)"
    one, other = [
        (r.label, rad_s_to_rpm(r.low), rad_s_to_rpm(r.high)) for r in down.ranges()
    ]
    assert one == ("P(1,1)", pytest.approx(136), pytest.approx(151))
    assert other == ("P(inf,1)", pytest.approx(130), pytest.approx(135.5))
