"""Detect and locate special points of a branch, and compute their normal forms."""

from ._extended import AbstractExtended as AbstractExtended, varied as varied
from ._locate import (
    ahead as ahead,
    cubic_between as cubic_between,
    locate as locate,
    Located as Located,
    pair_is_complex as pair_is_complex,
    singular_points as singular_points,
)
from ._monitor_points import MonitorPoints as MonitorPoints
from ._multilinear import second as second
from ._normal_forms import (
    flip_direction as flip_direction,
    normal_form as normal_form,
)
from ._singular_points import SingularPoints as SingularPoints
from ._test_functions import (
    BRANCH_POINT as BRANCH_POINT,
    eigenvalues_at as eigenvalues_at,
    FLIP as FLIP,
    FOLD as FOLD,
    HOPF as HOPF,
    is_stable as is_stable,
    NEIMARK_SACKER as NEIMARK_SACKER,
    test_values as test_values,
)
