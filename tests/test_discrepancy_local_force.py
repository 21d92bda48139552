"""The linearisation about a fit, with a force at every node."""

import numpy as np
import pytest

from jaxcam.discrepancy.search._local_force import _without_diverging
from jaxcam.fitting.engine import LinearPieces


def _pieces():
    """Two recordings of three pieces, with two states and one parameter."""
    shapes = {"information": (3, 3), "slope": (3,), "later": (2, 2), "earlier": (2, 3)}
    shapes |= {"direct": (2, 1), "tied": (2,), "flown_cost": (), "joint_cost": ()}
    parts = {name: np.ones((2, 3, *shape)) for name, shape in shapes.items()}
    parts |= {"pp": np.ones((2, 1, 1)), "p": np.ones((2, 1))}
    return LinearPieces(**parts, rested_cost=np.full((2, 1), np.nan))


@pytest.mark.parametrize("number", [np.nan, np.inf, -1e200])
def test_a_recording_whose_motion_diverges_says_nothing(number):
    """A motion that exceeds all bounds in one piece would make every sum infinite; an
    unknown cost does not matter."""
    given = _pieces()
    assert _without_diverging(given) is given
    given.information[1, 2, 0, 0] = number
    found = _without_diverging(given)
    for name in ("information", "slope", "later", "earlier", "direct", "tied", "p"):
        part = getattr(found, name)
        assert np.all(part[0] == 1) and np.all(part[1] == 0)
