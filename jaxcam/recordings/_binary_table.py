"""Columns of numbers from MATLAB and Parquet files."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from ._errors import RecordingError


def read_mat(file: Path) -> dict[str, Float[np.ndarray, " k"]]:
    """Vectors of a MATLAB file (up to version 7.2) by their names.

    Fields of a structure count as vectors too; anything else is ignored.

    **Raises:** `RecordingError` for a file that is none, or holds no vectors of equal
    length.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        found = loadmat(file, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        raise RecordingError(
            f"{file}: this is a MATLAB file of version 7.3; save it again with "
            f"`save(..., '-v7')`."
        ) from None
    except (ValueError, TypeError, OSError, EOFError, MatReadError) as error:
        if isinstance(error, FileNotFoundError):
            raise _missing(file) from None
        raise RecordingError(
            f"{file}: this is not a MATLAB file; save it again with `save(..., '-v7')`."
        ) from None
    columns: dict[str, np.ndarray] = {}
    for name, value in found.items():
        if name.startswith("__"):
            continue
        fields = getattr(value, "_fieldnames", None)
        if fields is None:
            columns[name] = value
        else:
            columns |= {field: getattr(value, field) for field in fields}
    vectors = {
        name: np.asarray(value, dtype=float)
        for name, value in columns.items()
        if isinstance(value, np.ndarray)
        and value.ndim == 1
        and np.issubdtype(value.dtype, np.number)
    }
    if "time_s" in vectors:
        length = len(vectors["time_s"])
    else:
        length = max((len(v) for v in vectors.values()), default=0)
    return _checked(file, {n: v for n, v in vectors.items() if len(v) == length})


def read_parquet(file: Path) -> dict[str, Float[np.ndarray, " k"]]:
    """Columns of a Parquet file; needs the package `pyarrow`.

    **Raises:** `RecordingError` where that is missing, or for a file that is none.
    """
    import pandas as pd

    if not file.exists():
        raise _missing(file)
    try:
        table = pd.read_parquet(file)
    except ImportError:
        raise RecordingError(
            f"{file}: to read Parquet, install the package pyarrow (pip install "
            f"pyarrow), or save the table as CSV."
        ) from None
    except (ValueError, OSError):
        raise RecordingError(
            f"{file}: this is not a Parquet file; save the table again, or as CSV."
        ) from None
    columns = {}
    for name in table.columns:
        try:
            columns[str(name)] = table[name].to_numpy(dtype=float)
        except (ValueError, TypeError):
            raise RecordingError(
                f"{file}: the column `{name}` is not numbers; remove it."
            ) from None
    return _checked(file, columns)


def _checked(file: Path, columns):
    if not columns or len(next(iter(columns.values()))) < 2:
        raise RecordingError(
            f"{file}: there are no columns of at least two numbers in it; save a "
            f"vector for the time (`time_s`) and one for each channel."
        )
    for name, values in columns.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise RecordingError(
                f"{file}: the column `{name}` has {values[bad[0]]} where a number "
                f"should be, in row {bad[0] + 1}; remove those rows or the column."
            )
    return columns


def _missing(file: Path) -> RecordingError:
    return RecordingError(f"{file}: there is no such file; check the path.")
