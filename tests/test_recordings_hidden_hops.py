"""Where contact is beyond doubt, and where a record's ends hide what happened."""

import dataclasses
import math

import numpy as np
import pytest

from jaxcam.data import DEMO_RIG
from jaxcam.models import float_speed
from jaxcam.recordings import read_rig
from jaxcam.recordings.cut._cut import settling_time
from jaxcam.recordings.cut._hidden_hops import before_release, hop_phases, sure_contact
from jaxcam.recordings.cut._record_ends import settled_alike
from jaxcam.recordings.cut._segments import Boundary, Contact, Flight


@pytest.fixture(scope="module")
def rig():
    return read_rig(DEMO_RIG / "rig.toml")


def test_no_hop_is_suspected_far_below_valve_float(rig):
    speed = float(float_speed(rig.system(1.0)).speed)
    assert not hop_phases(rig, 0.85 * speed).any()


def test_just_above_valve_float_hops_are_suspected_after_the_release(rig):
    """For a part of the turn, not everywhere; the faster the cam, the longer."""
    lift = float_speed(rig.system(1.0))
    speed = float(lift.speed)
    shares = [hop_phases(rig, part * speed).mean() for part in (1.0, 1.02, 1.05)]
    assert 0 < shares[0] <= shares[1] <= shares[2] < 1


def test_doubt_is_gone_where_the_release_was_seen():
    doubtful = np.zeros(100, dtype=bool)
    doubtful[10:20] = doubtful[50:60] = True
    sure = sure_contact(doubtful, np.array([52]))
    assert not sure[10:20].any()
    assert sure[:10].all() and sure[20:].all()


def test_a_contact_that_the_record_cuts_off_ends_where_others_were_released():
    """With a release seen at 5 rad of each turn, from 0.1 rad before that phase on."""
    angle = np.linspace(0.0, 6 * math.pi, 3001)
    seen = np.array(
        [int(np.searchsorted(angle, 5.0 + 2 * math.pi * k)) for k in (0, 1)]
    )
    first = int(np.searchsorted(angle, 4 * math.pi + 1.0))
    sure = before_release(angle, first, seen)
    assert angle[sure].max() == pytest.approx(4 * math.pi + 4.9, abs=0.02)
    assert before_release(angle, first, seen[:0]).all()


def test_a_contact_at_the_beginning_settles_as_late_as_the_others():
    def boundary(time, kind):
        return Boundary(time, 1e-3, kind, "")

    landing = boundary(2.0, "landing")
    flight = Flight(boundary(1.5, "release"), landing, 150, 200, 0.1)
    first = Contact(boundary(0.0, "end of record"), flight.start, 0, 150, 0.0)
    second = Contact(landing, boundary(2.5, "release"), 200, 250, 2.2)
    short = Contact(boundary(0.0, "end of record"), boundary(0.1, "release"), 0, 9, 0.0)
    found = settled_alike([first, short, second], [flight])
    assert [one.settled for one in found] == pytest.approx([0.2, 0.1, 2.2])


def test_bounces_are_waited_for_from_the_latest_landing_that_is_possible():
    """A flight of 10 to 14 ms and a restitution of a half: 10 to 14 ms more."""
    flight = Flight(
        Boundary(1.0, 1e-4, "impact", ""),
        Boundary(1.01, 4e-3, "landing", ""),
        0,
        5,
        0.1,
    )
    settled = settling_time(flight, 0.5)
    assert settled == pytest.approx(1.028)
    exact = dataclasses.replace(flight, stop=Boundary(1.01, 0.0, "landing", ""))
    assert settling_time(exact, 0.5) == pytest.approx(1.02)
