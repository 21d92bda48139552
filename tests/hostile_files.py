"""Files that nobody meant to write: what readers may be handed."""

import functools
import gzip
import io
import json
import math
import warnings

import numpy as np
import scipy.io
from hypothesis import strategies as st

from jaxcam import models
from jaxcam.data import DEMO_RIG
from jaxcam.discrepancy.terms import saved_classes
from jaxcam.models import load_system
from jaxcam.recordings import read_rig, RecordingError, RigError
from jaxcam.recordings.files import read_recordings


SPEED = 150 * math.pi / 30
CHANNELS = ("cam_angle_rad", "follower_angle_rad")


def columns(samples=300, rate=1000.0):
    """A short recording: a third of a second, a cam turning at 150 rpm."""
    time = np.arange(samples) / rate
    follower = 0.3 + 0.1 * np.sin(SPEED * time)
    return {"time_s": time, CHANNELS[0]: SPEED * time, CHANNELS[1]: follower}


@functools.cache
def table() -> str:
    rows = zip(*columns().values(), strict=True)
    lines = [",".join(columns()), *(",".join(f"{x:.6f}" for x in row) for row in rows)]
    return "\n".join(lines) + "\n"


@functools.cache
def matlab(**options) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(stream, columns(), **options)
    return stream.getvalue()


@functools.cache
def rig() -> str:
    return (DEMO_RIG / "rig.toml").read_text(encoding="utf-8")


@functools.cache
def system(name: str) -> str:
    made = {"ball": models.BouncingBall, "rig": models.CamFollower}[name]()
    return json.dumps(models.saved.system_to_json(made), indent=1)


# --- pieces

#: what stands where a number should
WORDS = st.sampled_from(
    """
    nan NaN inf -inf 1e999 -1e308 1e-320 0 -0.0 1_0 0x10 1j True None null 1e400 1d3
    '' "" "1" '1 1,5 1;2 1e 1e+ . - + -- # // \\ { } [ ] {} [] [[ ]] [1,2] = == 1.2.3
    ١ \x00 \x1a \x0c \u2028 \ufeff \x1b[31m 2020-01-01 12:30:00 time_s %s {0} ../..
    """.split()
    + ["", " ", "\n", "\r", "\t", "9" * 400, "9" * 5000, "x" * 3000, "[" * 3000]
)
NUMBERS = st.floats() | st.integers(-(10**30), 10**30) | st.just(10**400)
#: JSON and TOML values of any kind
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(max_size=6) | WORDS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text(max_size=6) | WORDS, inner, max_size=3)
    ),
    max_leaves=6,
)


@st.composite
def torn(draw, content: bytes) -> bytes:
    """A file after a few bytes were lost, changed, doubled, or put elsewhere."""
    for _ in range(draw(st.integers(1, 3))):
        a, b = sorted(draw(st.tuples(*[st.integers(0, len(content))] * 2)))
        b = draw(st.sampled_from([b, min(len(content), a + 4)]))
        middle = draw(
            st.sampled_from([b"", content[a:b] * 2, content[:40], b"\0" * 16])
            | st.binary(max_size=12)
        )
        content = draw(
            st.sampled_from([content[:a], content[:a] + middle + content[b:]])
        )
    return content


@st.composite
def worded(draw, text: str, mark: str = ",") -> str:
    """A text with words in it that do not belong there."""
    for _ in range(draw(st.integers(1, 3))):
        lines = text.split("\n")
        k = draw(st.integers(0, len(lines) - 1) | st.just(0))
        cells = lines[k].split(mark)
        j = draw(st.integers(0, len(cells) - 1))
        cells[j] = draw(WORDS)
        new = mark.join(cells)
        changed = draw(st.sampled_from([[new], [], [new, new], [lines[k], lines[k]]]))
        text = "\n".join([*lines[:k], *changed, *lines[k + 1 :]])
    return text


@st.composite
def altered(draw, found):
    """Plain data with a value of another kind, a key too many or one too few."""
    if isinstance(found, dict) and found and draw(st.integers(0, 5)):
        key = draw(st.sampled_from(sorted(found)))
        how = draw(st.sampled_from(["inside", "inside", "inside", "lost", "renamed"]))
        if how == "inside":
            return {**found, key: draw(altered(found[key]))}
        rest = {k: v for k, v in found.items() if k != key}
        return rest if how == "lost" else {**rest, draw(WORDS): found[key]}
    if isinstance(found, list) and found and draw(st.booleans()):
        k = draw(st.integers(0, len(found) - 1))
        return [*found[:k], draw(altered(found[k])), *found[k + 1 :]]
    return draw(VALUES)


# --- whole files: a name and its bytes


def encoded(text: str, how: str) -> bytes:
    return text.encode(how, errors="surrogatepass")


ENCODINGS = st.sampled_from(["utf-8", "utf-8", "utf-8-sig", "utf-16", "utf-32"])


@st.composite
def tables(draw) -> tuple[str, bytes]:
    mark, end = draw(st.sampled_from(",;\t")), draw(st.sampled_from(["\n", "\r\n"]))
    text = table()
    if draw(st.booleans()):
        text = draw(worded(text))
    text = text.replace(",", mark).replace("\n", end)
    raw = encoded(text, draw(ENCODINGS))
    if draw(st.booleans()):
        raw = draw(torn(raw))
    name = draw(st.sampled_from(["run1_150rpm", "run", "run_0rpm", "run_1e9rpm", ""]))
    if draw(st.booleans()):
        raw = gzip.compress(raw, 1, mtime=0)
        if draw(st.booleans()):
            raw = draw(torn(raw))
        return f"{name}.csv.gz", raw
    return f"{name}.csv", raw


@st.composite
def matlab_files(draw) -> tuple[str, bytes]:
    how = draw(st.sampled_from([{}, {"do_compression": True}, {"format": "4"}]))
    return "run1_150rpm.mat", draw(torn(matlab(**how)) | st.binary(max_size=300))


@st.composite
def rigs(draw) -> bytes:
    text = rig()
    for _ in range(draw(st.integers(1, 2))):
        text = draw(worded(text, draw(st.sampled_from(["=", " ", ",", '"', "."]))))
    raw = encoded(text, draw(ENCODINGS))
    return draw(torn(raw)) if draw(st.booleans()) else raw


@st.composite
def systems(draw) -> bytes:
    text = system(draw(st.sampled_from(["ball", "rig"])))
    how = draw(st.sampled_from(["altered", "altered", "worded", "torn"]))
    if how == "altered":
        # NaN and Infinity are what Python writes; other programs write null
        return encoded(json.dumps(draw(altered(json.loads(text)))), "utf-8")
    text = draw(worded(text, draw(st.sampled_from([":", ",", '"'])))) if (
        how == "worded"
    ) else text  # fmt: skip
    return draw(torn(text.encode())) if how == "torn" else encoded(text, "utf-8")


# --- what a reader may do with them


def said(error: Exception) -> None:
    """One sentence, on one line, of a length that is read."""
    sentence = str(error)
    assert sentence and "\n" not in sentence and sentence[-1] in ".?", sentence
    assert len(sentence) < 600, sentence
    assert sentence.isprintable(), repr(sentence)


def read_table_or_say(folder, name: str, raw: bytes, gaps: str) -> bool:
    """Read a recording, or be told in one sentence; whether it was read."""
    file = folder / name
    file.write_bytes(raw)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            runs = read_recordings(file, channels=CHANNELS, gaps=gaps)  # pyright: ignore
        except RecordingError as error:
            said(error)
            return False
    assert runs
    for run in runs:
        assert len(run.time) > 1 and np.all(np.diff(run.time) > 0)
        for samples in (run.time, *run.channels.values()):
            assert samples.shape == run.time.shape and np.all(np.isfinite(samples))
            assert samples.dtype == np.float64
    return True


def read_rig_or_say(folder, raw: bytes) -> bool:
    file = folder / "rig.toml"
    file.write_bytes(raw)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = read_rig(file)
            assert math.isfinite(found.sensors.follower_floor + found.sensors.cam_floor)
        except RigError as error:
            said(error)
            return False
    return True


def load_system_or_say(folder, raw: bytes) -> bool:
    file = folder / "system.json"
    file.write_bytes(raw)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = load_system(file, classes=saved_classes())
        except ValueError as error:
            said(error)
            return False
    found.check()
    return True
