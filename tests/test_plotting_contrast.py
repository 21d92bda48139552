"""Every colour of lines and markers can be seen on a light and on a dark page."""

import numpy as np
import pytest
from matplotlib import rc_params_from_file
from matplotlib.colors import to_rgb, to_rgba_array

from jaxcam.plotting import _branch, _dark, _style, colours


# Web Content Accessibility Guidelines 2.1, success criterion 1.4.11: graphical objects
LEAST = 3.0
STYLE = rc_params_from_file(_style._STYLE_FILE, use_default_template=False)
# areas behind lines and markers, which need no contrast of their own
AREAS = {"BAND"}
LINES = {
    **{name: one for name, one in vars(colours).items() if name.isupper()},
    **{f"gap {k}": _style.gap_colour(k) for k in range(5)},
    **{kind: colour for kind, (_, colour) in _branch._MARKS.items()},
    **{
        f"cycle {k}": c
        for k, c in enumerate(STYLE["axes.prop_cycle"].by_key()["color"])
    },
    **{
        name: STYLE[name]
        for name in ("axes.edgecolor", "xtick.color", "ytick.labelcolor")
    },
}


def luminance(colour):
    linear = np.array(to_rgb(colour))
    linear = np.where(
        linear <= 0.04045, linear / 12.92, ((linear + 0.055) / 1.055) ** 2.4
    )
    return linear @ [0.2126, 0.7152, 0.0722]


def contrast(one, other):
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def test_the_contrast_of_black_to_white_is_21():
    assert contrast("black", "white") == pytest.approx(21)


@pytest.mark.parametrize("name", sorted(set(LINES) - AREAS))
def test_lines_and_markers_are_seen_on_both_pages(name):
    colour = LINES[name]
    assert contrast(colour, STYLE["figure.facecolor"]) >= LEAST
    turned = _dark.dark(to_rgba_array(colour))[0]
    assert contrast(tuple(turned), tuple(_dark._BACKGROUND)) >= LEAST
