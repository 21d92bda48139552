"""Propagate frames of tangent vectors in the compiled event loop."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import Settings
from jaxcam.hybrid.batch import Horizon, Lanes, run_tangents, Table
from jaxcam.hybrid.codes import RowKind


# maximum number of entries in the table of a group of motions
_MOST = 2**24


def _row(record, carried):
    """Return the place in the table (-1 for none) and the entries to store there: sums
    of the logarithms of growth, number of impacts and state at the end of a period.
    """
    place = jnp.where(record.kind == float(RowKind.STOP), carried.state.stops, -1.0)
    return place, [*carried.logs, carried.state.impacts, *record.after]


def frames_of_periods(
    lanes: Lanes,
    horizon: Horizon,
    settings: Settings,
    max_steps: int,
    report: Callable[[float], None],
):
    """Return the values at the ends of all periods.

    **Arguments:** the motions, their horizon, the accuracy, the maximum number of
    attempted steps, and a function of the completed fraction.

    Returns:
        Sums of the logarithms of growth, `(motions, periods, n)`; numbers of impacts,
        `(motions, periods)`; states, `(motions, periods, n)`; and result codes.

    **Raises:** `Lacking` if the LLVM backend lacks an operation.
    """
    count, n = lanes.states.shape
    columns = 2 * n + 1
    group = max(1, _MOST // (horizon.number * columns))
    parts, codes = [], []
    for first in range(0, count, group):
        some = lanes.some(slice(first, first + group))
        table = Table(_row, len(some.states), horizon.number, columns, 1)

        def between(first=first, table=table):
            done = first * horizon.number + np.isfinite(table.numbers[..., 0]).sum()
            report(float(done) / (count * horizon.number))

        _, _, code = run_tangents(some, horizon, settings, max_steps, table, between)
        parts.append(table.numbers)
        codes.append(code)
        report(min(1.0, (first + group) / count))
    numbers = np.concatenate(parts)
    values = numbers[..., :n], numbers[..., n], numbers[..., n + 1 :]
    return *values, np.concatenate(codes)
