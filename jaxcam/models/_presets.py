"""Parameter sets with a name."""

from collections.abc import Callable

from ._cam_follower import CamFollower


_PRESETS: dict[str, Callable[[], CamFollower]] = {"table-4.4": CamFollower}


def preset(name: str) -> CamFollower:
    """The cam-follower with a named set of parameters.

    **Arguments:**

    - `name`: "table-4.4", the thesis' Table 4.4 as printed.

    **Raises:** `ValueError` for an unknown name.
    """
    if name not in _PRESETS:
        names = ", ".join(f'"{known}"' for known in _PRESETS)
        raise ValueError(f"Choose a preset among {names}; {name!r} is none of them.")
    return _PRESETS[name]()
