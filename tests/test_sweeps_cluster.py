"""Sweeps on a Dask cluster, which an extra brings."""

import os
import signal

import numpy as np
import pytest
from sweep_maps import SQUARE_ROOT

from jaxcam.models import ImpactOscillator
from jaxcam.sweeps import basins, cluster, Grid, Stroboscopic


GRID = Grid((-2, -2), (2, 2), (24, 10))


def test_an_address_that_is_none():
    pytest.importorskip("distributed")
    with pytest.raises(ValueError, match='choose "local"'):
        with cluster("somewhere"):
            pass


@pytest.mark.slow
# dask and its parts warn of each other's age, and of a port that is taken
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_changes_nothing_and_survives_the_loss_of_a_worker(tmp_path):
    """Two processes, one of them killed after the second block: the same bits."""
    distributed = pytest.importorskip("distributed")
    section = Stroboscopic(ImpactOscillator(omega=2.6), lanes=16)
    options = {"turns": 64, "block": 2}
    grid = Grid((-1, -2), (0, 2), (16, 8))
    whole = basins(section, grid, **options)
    killed = []

    def kill(at):
        if at.done == 2 and not killed:
            workers = distributed.default_client().run(os.getpid)
            killed.append(next(iter(workers.values())))
            os.kill(killed[0], signal.SIGKILL)

    with cluster("local", workers=2) as executor:
        plain = basins(SQUARE_ROOT, GRID, 40, block=3, executor=executor)
        found = basins(
            section,
            grid,
            **options,
            executor=executor,
            out=tmp_path / "sweep",
            progress=kill,
        )
    assert killed
    assert np.array_equal(plain.attractor, basins(SQUARE_ROOT, GRID, 40).attractor)
    for name in ("fingerprint", "impacts", "turns", "attractor", "orbit"):
        one, other = whole.dataset[name].values, found.dataset[name].values
        assert np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
