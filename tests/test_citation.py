"""The bibliography: what is asked for comes, complete and once."""

import re
from pathlib import Path

import pytest

import jaxcam
from jaxcam._citation import _entries, _TOPICS


ROOT = Path(__file__).parents[1]
NEEDED = {
    "article": {"author", "title", "journal", "year"},
    "book": {"author", "title", "publisher", "year"},
    "incollection": {"author", "title", "booktitle", "publisher", "year"},
    "phdthesis": {"author", "title", "school", "year"},
}


def keys_of(text):
    return re.findall(r"^@\w+\{([^,]+),$", text, re.MULTILINE)


def test_no_name_gives_the_tool_and_the_topics():
    text = jaxcam.citation()
    assert keys_of(text) == ["jaxcam"]
    assert f"version = {{{jaxcam.__version__}}}" in text
    # what BibTeX must not read starts with a percent sign
    outside = text.partition("\n}\n")[2].strip().splitlines()
    assert outside and all(line.startswith("%") for line in outside)
    for topic in _TOPICS:
        assert f" {topic}: " in text


def test_every_topic_has_entries_and_every_entry_a_topic():
    entries = _entries()
    used = {key for keys in _TOPICS.values() for key in keys}
    assert used == set(entries)
    source = (ROOT / "jaxcam" / "references.bib").read_text(encoding="utf-8")
    assert len(entries) == source.count("\n@") + source.startswith("@")
    for topic, keys in _TOPICS.items():
        assert keys_of(jaxcam.citation(topic)) == list(keys)


@pytest.mark.parametrize("key", _entries())
def test_entries_are_complete(key):
    entry = _entries()[key]
    kind = re.match(r"@(\w+)\{", entry)
    assert kind is not None
    fields = set(re.findall(r"^  (\w+) = \{", entry, re.MULTILINE))
    assert NEEDED[kind[1]] <= fields
    depth = 0
    for letter in entry:
        depth += (letter == "{") - (letter == "}")
        assert depth >= 0
    assert depth == 0


def test_an_entry_comes_once_in_any_writing():
    text = jaxcam.citation(" Saltation", "impacting systems", "KONG2024")
    assert keys_of(text) == ["leine2004", "dibernardo2008", "kong2024"]


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="'magic' is not a topic.*chatter.*saltation"):
        jaxcam.citation("chatter", "magic")
