"""Find impacts with flights of the model, where a motion hides them."""

from ._flown_impacts import located as located
from ._sampling import (
    shortest_period as shortest_period,
    with_coarse_note as with_coarse_note,
)
