"""Compare recordings with a model, flight by flight."""

from ._compare import compare as compare, compare_case as compare_case
from ._comparison import (
    Comparison as Comparison,
    merge as merge,
    Residuals as Residuals,
    Row as Row,
)
from ._flight_fit import size_of as size_of, state_at as state_at
