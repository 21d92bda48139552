"""Draw the figures of the documentation: `python docs/gallery/make.py [NAME ...]`, all
by default.

Each script in this folder makes one `figure`; the first paragraph of its docstring is
the caption. This program writes a light and a dark picture of each figure and the page
`docs/gallery.md`. For the name of a tutorial, such as `tour.md`, it runs the code of
the tutorial and writes the figures that this code saves.
"""

import ast
import io
import re
import runpy
import sys
import time
from pathlib import Path
from unittest import mock

import matplotlib


matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from PIL import Image

from jaxcam import plotting
from jaxcam.plotting import on_dark, style


HERE = Path(__file__).parent
PAGE = HERE.parent / "gallery.md"
OUT = HERE
# names of the figures, in the order in which the page shows them
ORDER = tuple((HERE / "order.txt").read_text("utf-8").split())
# tutorials with figures
TUTORIALS = ("tour.md", "real_recording.md")
# titles of the figures whose script names are not good titles
TITLES = {
    "cam_follower_chart": "Cam-follower chart",
    "curves_in_two_parameters": "Bifurcation curves in a two-parameter plane",
    "fit_with_band": "Fit with noise band",
    "held_out_residuals": "Held-out residuals",
    "stick_slip": "Stick-slip",
}
# dots per inch
DOTS = 130
# number of colours of a picture, few enough for a small file
COLOURS = 64

_TOP = """---
hide:
  - navigation
  - toc
---

# Gallery

Each figure links to the short script that draws it. You can run a script unchanged, or
change the system in it. The command `python docs/gallery/make.py` draws all figures in
a light version and, with [`jaxcam.plotting.on_dark`][], in a dark version.

<div class="grid cards" markdown>

"""
_CARD = """-   [![{title}](gallery/{name}-light.png#only-light){{ loading=lazy }}
    ![{title}](gallery/{name}-dark.png#only-dark){{ loading=lazy }}](#{anchor})

    **[{title}](#{anchor})**

    {caption}

"""
_PART = """
## {title} {{ #{anchor} }}

{caption}

![{caption}](gallery/{name}-light.png#only-light){{ width=640 loading=lazy }}
![{caption}](gallery/{name}-dark.png#only-dark){{ width=640 loading=lazy }}

``` {{ .python title="docs/gallery/{name}.py" }}
--8<-- "docs/gallery/{name}.py"
```
"""


def caption(name: str) -> str:
    """Return the caption of a script, on one line."""
    words = ast.get_docstring(ast.parse((HERE / f"{name}.py").read_text("utf-8")))
    assert words, f"{name}.py has no docstring"
    return " ".join(words.split("\n\n")[0].split())


def draw(name: str) -> None:
    """Run a script and write both its pictures."""
    _write_both(runpy.run_path(str(HERE / f"{name}.py"))["figure"], OUT / name)


def saved(name: str) -> list[str]:
    """Return the figures that the code of a tutorial saves, without the suffix."""
    text = (PAGE.parent / name).read_text("utf-8")
    return re.findall(r'save_figure\(\w+(?:\(\w+\))?, "(.*)\.png"\)', text)


def draw_tutorial(name: str) -> None:
    """Run the code of a tutorial up to its last figure, and write its figures."""
    text = (PAGE.parent / name).read_text("utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    last = max(k for k, block in enumerate(blocks) if "save_figure(" in block)
    names = {"__name__": name}
    with mock.patch.object(plotting, "save_figure", _save):
        for block in blocks[: last + 1]:
            exec(block, names)


def _save(figure: Figure, path: str) -> None:
    path_in_docs = PAGE.parent / Path(path).with_suffix("")
    path_in_docs.parent.mkdir(exist_ok=True)
    _write_both(figure, path_in_docs)


def _write_both(figure: Figure, path: Path) -> None:
    _write(figure, path.with_name(f"{path.name}-light.png"))
    _write(on_dark(figure), path.with_name(f"{path.name}-dark.png"))
    plt.close(figure)


def _write(figure: Figure, path: Path) -> None:
    drawn = io.BytesIO()
    with style():
        figure.savefig(drawn, dpi=DOTS, facecolor=figure.get_facecolor())
    picture = Image.open(drawn).convert("RGB")
    # keeps the colour of a few thin lines, which has a meaning
    few = picture.quantize(
        COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
    )
    few.save(path, optimize=True)


def page() -> str:
    """Return the text of `docs/gallery.md`."""
    parts = {
        name: dict(
            name=name,
            anchor=name.replace("_", "-"),
            title=TITLES.get(name, name.replace("_", " ").capitalize()),
            caption=caption(name),
        )
        for name in ORDER
    }
    cards = "".join(_CARD.format(**part) for part in parts.values())
    texts = "".join(_PART.format(**part) for part in parts.values())
    return f"{_TOP}{cards}</div>\n{texts}"


if __name__ == "__main__":
    for name in sys.argv[1:] or (*ORDER, *TUTORIALS):
        began = time.time()
        if name in TUTORIALS:
            draw_tutorial(name)
            print(f"{name}: {time.time() - began:.0f} s", flush=True)
            continue
        draw(name)
        size = sum(f.stat().st_size for f in HERE.glob(f"{name}-*.png")) / 1000
        print(f"{name}: {time.time() - began:.0f} s, {size:.0f} kB", flush=True)
    PAGE.write_text(page(), "utf-8")
