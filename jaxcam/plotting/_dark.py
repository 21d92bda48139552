"""Recolour a figure for a dark page."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import Collection
from matplotlib.colors import ListedColormap, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation, Text


# the background and text colours of dark pages in mkdocs-material
_BACKGROUND = np.array([0x1E, 0x21, 0x29]) / 255
_TEXT = np.array([0.92, 0.92, 0.94])
# colours are lightened by this amount, because pure blue is hard to see on black
_LIGHTER = 0.25
# difference between the red, green and blue values above which a colour is not grey
_COLOURFUL = 0.25
# properties of an artist that contain a colour
_PROPERTIES = {
    Line2D: ("color", "markerfacecolor", "markeredgecolor"),
    Patch: ("edgecolor", "facecolor"),
    Collection: ("edgecolor", "facecolor"),
    Text: ("color",),
}


def on_dark(figure: Figure) -> Figure:
    """Recolour a figure for a dark page: greys are inverted and colours lightened.

    The figure is changed in place; save the light version first.

    Args:
        figure: The figure.

    Returns:
        The same figure.

    Examples:
        >>> from jaxcam.plotting import lambda_cobweb, on_dark
        >>> drawn = on_dark(lambda_cobweb(0.5))
    """
    # ticks are created when a figure is drawn
    figure.canvas.draw()
    for artist in figure.findobj():
        if isinstance(artist, Axes):
            _recolour_ticks(artist)
        for kind, names in _PROPERTIES.items():
            if isinstance(artist, kind):
                _recolour(artist, names)
        if isinstance(artist, Text) and artist.get_bbox_patch() is not None:
            _recolour(artist.get_bbox_patch(), _PROPERTIES[Patch])
        if isinstance(artist, Annotation) and artist.arrow_patch is not None:
            _recolour(artist.arrow_patch, _PROPERTIES[Patch])
        if isinstance(artist, ScalarMappable) and artist.get_array() is not None:
            _recolour_values(artist)
        # the halo of a label has the colour of the page
        if artist.get_path_effects():
            halo = tuple(_BACKGROUND)
            artist.set_path_effects([withStroke(linewidth=2.5, foreground=halo)])
    return figure


def dark(colours: np.ndarray) -> np.ndarray:
    """Convert RGBA colours, shape `(..., 4)`, for a dark page."""
    rgb, alpha = colours[..., :3], colours[..., 3:]
    turned = _TEXT + rgb.mean(axis=-1, keepdims=True) * (_BACKGROUND - _TEXT)
    lightened = rgb + _LIGHTER * (1 - rgb)
    share = np.clip(np.ptp(rgb, axis=-1, keepdims=True) / _COLOURFUL, 0, 1)
    return np.concatenate([turned + share * (lightened - turned), alpha], axis=-1)


def _recolour(artist, names: tuple[str, ...]) -> None:
    # all colours are read before any is set, because setting one may change another
    colours = {name: getattr(artist, f"get_{name}")() for name in names}
    for name, colour in colours.items():
        if isinstance(colour, str) and colour in ("none", "auto"):
            continue
        changed = dark(to_rgba_array(colour))
        if isinstance(artist, Collection):
            getattr(artist, f"set_{name}")(changed)
        else:
            getattr(artist, f"set_{name}")(tuple(changed[0]))


def _recolour_values(artist: ScalarMappable) -> None:
    values = np.asarray(artist.get_array())
    if isinstance(artist, AxesImage) and values.ndim == 3:
        artist.set_data(dark(values))
        return
    colours = np.asarray(artist.cmap(np.arange(artist.cmap.N)))
    artist.set_cmap(ListedColormap(dark(colours)))


def _recolour_ticks(axes: Axes) -> None:
    # set the parameters of the axis, so that ticks created later have these colours too
    for axis in (axes.xaxis, axes.yaxis):
        parameters = axis.get_tick_params()
        found = {
            name: tuple(dark(to_rgba_array(parameters[name]))[0])
            for name in ("color", "labelcolor", "grid_color")
            if name in parameters
        }
        axis.set_tick_params("major", False, **found)
