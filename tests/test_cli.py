"""The commands, as a reader types them."""

import json
import math
import re
import shlex

import click
import numpy as np
import pytest
from typer.main import get_command
from typer.testing import CliRunner

from jaxcam.cli import app


@pytest.fixture(autouse=True)
def keep_the_cache_of_the_tests(monkeypatch):
    """A command sets the folder of compiled programs; here it is the tests' own."""
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "as the tests have it")


def jaxcam(*arguments, ok=True):
    found = CliRunner().invoke(app, [str(a) for a in arguments])
    if ok:
        assert found.exit_code == 0, found.output
    return found


def refused(*arguments) -> str:
    """The one sentence of a command that cannot be carried out."""
    found = jaxcam(*arguments, ok=False)
    assert found.exit_code == 2, found.output
    assert found.stdout == ""
    (line,) = found.stderr.splitlines()
    assert line.endswith(".") and line[:1].strip()
    return line


def examples():
    for name in (None, "simulate", "demo"):
        arguments = ["--help"] if name is None else [name, "--help"]
        text = jaxcam(*arguments).stdout
        found = re.findall(r"^\s+(jaxcam (?:simulate|demo).*?)\s*$", text, re.MULTILINE)
        assert found
        yield from found


def test_version():
    import jaxcam as package

    assert jaxcam("--version").stdout == f"jaxcam {package.__version__}\n"


def test_examples_in_the_help_name_options_that_exist():
    commands = get_command(app).commands  # pyright: ignore
    for line in examples():
        _, name, *arguments = shlex.split(line)
        context = commands[name].make_context(name, arguments)
        assert context.params
