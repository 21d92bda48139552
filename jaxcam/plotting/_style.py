"""The common style of all figures, and the meaning of its colours."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

import matplotlib.pyplot as plt
from matplotlib.figure import Figure


_STYLE_FILE = Path(__file__).with_name("jaxcam.mplstyle")

# Okabe-Ito colours, with their meaning in all figures; orange and sky blue are darker
# than in that palette, because lines and markers need a contrast of 3:1 to the page
FLIGHT = "#0072B2"
IMPACT = "#D55E00"
CONTACT = "#C27F00"
SECTION = "#000000"
RECORDED = "#8C8C8C"
BAND = "#BDBDBD"
CAM = "#8A5F00"
# colour of a second item of the same kind, such as another method or manifold
SECOND = "#009E73"
PURPLE = "#CC79A7"
SKY = "#2F8FC4"
# colours of several constraints, different from those of impacts and contacts
_GAPS = (FLIGHT, SECOND, PURPLE, SKY, SECTION)

_P = ParamSpec("_P")
_R = TypeVar("_R")


def gap_colour(number: int) -> str:
    """Return the colour of one of several constraints."""
    return _GAPS[number % len(_GAPS)]


def style():
    """Return a context in which figures have the style of the project.

    Returns:
        A context manager.

    Examples:
        >>> from jaxcam.plotting import multipliers, style
        >>> with style():
        ...     figure = multipliers(np.array([0.5]))
    """
    return plt.style.context(_STYLE_FILE)


def styled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Draw in the style of the project without changing the user's settings."""

    @functools.wraps(function)
    def wrapper(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with style():
            return function(*args, **kwargs)

    return wrapper


def save_figure(figure: Figure, path: str | Path) -> Path:
    """Write a figure to a file, at the resolution of the style, and close it.

    The folder is created if it does not exist; the suffix of the name determines the
    format.

    Args:
        figure: The figure.
        path: The file to write.

    Returns:
        The path.

    Examples:
        >>> from jaxcam.plotting import multipliers, save_figure
        >>> save_figure(multipliers(np.array([0.5])), "circle.png").name
        'circle.png'
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with style():
        figure.savefig(path)
    plt.close(figure)
    return path
