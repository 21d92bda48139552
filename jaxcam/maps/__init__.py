"""Smooth and piecewise-smooth iterated maps, with their orbits and bifurcations."""

from ._attractor import map_attractor as map_attractor
from ._border_collision import (
    border_collision as border_collision,
    classify_border_collision as classify_border_collision,
)
from ._cascade import feigenbaum_ratios as feigenbaum_ratios, superstable as superstable
from ._iterate import iterate as iterate, map_diagram as map_diagram
from ._logistic import LogisticMap as LogisticMap
from ._manifold import (
    grow_manifold as grow_manifold,
    Saddle as Saddle,
    saddle_at as saddle_at,
)
from ._piecewise import (
    PiecewiseMap as PiecewiseMap,
    SkewMap as SkewMap,
    SquareRootMap as SquareRootMap,
)
