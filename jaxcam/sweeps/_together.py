"""Find the attractors of all blocks, and the attractor of each state."""

import numpy as np
import xarray

from ._basins_job import BasinsJob
from ._basins_result import Basins
from .attractors import (
    APERIODIC,
    attractor_names,
    Attractors,
    find_attractors,
    match_orbits,
    OUTSIDE,
    settle,
)
from .blocks import Store
from .sections import AbstractSection, component_coordinates


_SHOWN = 64
"""Maximum number of points kept for each attractor."""
_ALIKE = 0.05
"""Distance, in units of the scale, below which an orbit is regarded as identical to a
known orbit.
"""


def together(job: BasinsJob, store: Store, known: Basins | None) -> xarray.Dataset:
    """Return a dataset with the attractor number of each state, and the attractors."""
    grid, section, layout = job.grid, job.section, job.layout
    impacts, turns, fingerprint = [], [], []
    visited, lanes = [], 0
    for block in range(layout.blocks):
        part = store.read(block)
        impacts.append(part["impacts"].ravel())
        turns.append(part["turns"].ravel())
        fingerprint.append(part["fingerprint"].reshape(len(turns[-1]), -1))
        (some,) = np.nonzero(turns[-1] == APERIODIC)
        visited.append((block, lanes + some, some))
        lanes += len(turns[-1])
    impacts, turns = np.concatenate(impacts), np.concatenate(turns)
    if np.all(turns == OUTSIDE):
        raise ValueError(
            "all states of the grid violate gap >= 0; choose low and high such that it "
            "contains states with every gap at zero or above"
        )

    def cells():
        for block, place, some in visited:
            keep = job.settings[1]
            yield place, store.read(block)["cells"].reshape(-1, keep)[some]

    starts = grid.states()
    number, found = find_attractors(
        impacts, turns, np.concatenate(fingerprint), cells(), starts, job.same
    )
    orbit = _orbits(section, starts[found.lane], job)
    labels = np.stack([found.impacts, found.turns], axis=1)
    if known is not None:
        number, labels, orbit = _renumbered(number, found, orbit, known)
    dims = layout.variables["turns"].dims
    names = np.array(attractor_names(*labels.T), dtype=object)
    components = component_coordinates(section.names(len(grid.shape)))
    about = "number of the attractor; -1 escaped, -2 failed, -3 inadmissible"
    return xarray.Dataset(
        {
            "attractor": (dims, number.reshape(grid.shape).astype(np.int32),
                          {"about": about}),
            "orbit": (("number", "sample_of_orbit", "component"), orbit),
            "orbit_impacts": ("number", labels[:, 0].astype(np.int32)),
            "orbit_turns": ("number", labels[:, 1].astype(np.int32)),
        },
        {"number": np.arange(len(labels)), "name": ("number", names), **components},
    )  # fmt: skip


def _orbits(section: AbstractSection, starts, job: BasinsJob) -> np.ndarray:
    """Return the final points of the motions that represent the attractors, in the
    order of the attractors.
    """
    turns, keep, period_tolerance, reruns = job.settings
    n = len(job.grid.shape)
    made = np.full((len(starts), min(_SHOWN, turns), n), np.nan)
    if not len(starts):
        return made
    samples, labels = settle(
        section, starts, turns, keep, period_tolerance=period_tolerance, reruns=reruns
    )
    longer = section.sample(samples.final, turns, made.shape[1]).states
    for k, length in enumerate(labels.turns):
        orbit = longer[k]
        if length > 0:
            # list the points of a periodic orbit from the smallest one onwards
            one = orbit[:length]
            first = int(np.lexsort(np.round(one, 6).T[::-1])[0])
            orbit = np.full_like(orbit, np.nan)
            orbit[:length] = np.roll(one, -first, axis=0)
        made[k] = orbit
    return made


def _renumbered(number, found: Attractors, orbit, known: Basins):
    """Renumber the attractors as in the `known` basins; attractors that are not known
    are appended.

    **Returns:** the attractor number of each state; the labels and orbits of all
    attractors.
    """
    labels = np.stack([found.impacts, found.turns], axis=1)
    both = (known.labels, labels)
    pairs = match_orbits(known.orbits, orbit, known.scale, _ALIKE, both)
    old = len(known.names)
    fresh = [k for k in range(len(found)) if k not in pairs]
    new = np.array(
        [pairs[k] if k in pairs else old + fresh.index(k) for k in range(len(found))],
        dtype=int,
    )
    if len(new):
        number = np.where(number >= 0, new[np.maximum(number, 0)], number)
    labels = np.concatenate([known.labels, labels[fresh]])
    points = max(known.orbits.shape[1], orbit.shape[1])
    orbits = np.full((len(labels), points, orbit.shape[2]), np.nan)
    orbits[:old, : known.orbits.shape[1]] = known.orbits
    orbits[old:, : orbit.shape[1]] = orbit[fresh]
    return number, labels, orbits
