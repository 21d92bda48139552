"""The gallery: every script has its pictures and its place on the page."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from jaxcam.plotting.colours import CONTACT, FLIGHT, IMPACT


GALLERY = Path(__file__).parents[1] / "docs" / "gallery"


@pytest.fixture(scope="module")
def make():
    spec = importlib.util.spec_from_file_location("make", GALLERY / "make.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_script_is_listed_and_has_a_light_and_a_dark_picture(make):
    scripts = {file.stem for file in GALLERY.glob("*.py")} - {"make"}
    assert set(make.ORDER) == scripts and len(make.ORDER) == len(scripts)
    pictures = {f"{name}-{theme}" for name in scripts for theme in ("light", "dark")}
    assert {file.stem for file in GALLERY.glob("*.png")} == pictures


def test_pictures_are_small_and_as_dark_as_their_names_say():
    files = sorted(GALLERY.glob("*.png"))
    assert sum(file.stat().st_size for file in files) < 2.5e6
    for file in files:
        corner = np.asarray(Image.open(file).convert("L"))[-3:, :3]
        assert np.all(corner > 250) if "light" in file.stem else np.all(corner < 60)


def test_few_colours_keep_that_of_a_thin_line():
    """The dashes of an impact are a hundred pixels of a picture of 64 colours."""
    drawn = np.asarray(Image.open(GALLERY / "phase_portrait-light.png").convert("RGB"))
    for colour in (CONTACT, FLIGHT, IMPACT):
        away = np.abs(drawn - 255 * np.array(to_rgb(colour))).sum(axis=-1)
        assert np.sum(away < 20) > 50, colour


def test_the_page_is_what_the_scripts_make_of_it(make):
    assert make.PAGE.read_text("utf-8") == make.page()


def test_a_tutorial_shows_the_figures_that_its_code_saves(make):
    docs = GALLERY.parent
    for name in make.TUTORIALS:
        text, figures = (docs / name).read_text("utf-8"), make.saved(name)
        assert len(figures) == text.count("save_figure(")
        for figure in figures:
            for theme in ("light", "dark"):
                assert f"({figure}-{theme}.png#only-{theme})" in text
                picture = Image.open(docs / f"{figure}-{theme}.png").convert("L")
                corner = np.asarray(picture)[-3:, :3]
                assert np.all(corner > 250 if theme == "light" else corner < 60)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["chatter_map", "zeno_staircase"])
def test_a_script_draws_its_picture(name, make, tmp_path, monkeypatch):
    kept = Image.open(GALLERY / f"{name}-light.png").convert("RGB")
    monkeypatch.setattr(make, "OUT", tmp_path)
    make.draw(name)
    made = Image.open(tmp_path / f"{name}-light.png").convert("RGB")
    assert made.size == kept.size
    # fonts may differ by a hair from machine to machine
    assert np.mean(np.abs(np.subtract(made, kept, dtype=float))) < 8
    assert (tmp_path / f"{name}-dark.png").exists()
