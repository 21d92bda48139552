"""Options in groups: typer sees fields, the command is given dataclasses."""

import dataclasses
from typing import Annotated

import typer
from typer.testing import CliRunner

from jaxcam.cli._grouped import grouped


@dataclasses.dataclass(frozen=True)
class Box:
    low: Annotated[float, typer.Option("--from", help="Lowest.")] = 0.0
    high: Annotated[float | None, typer.Option("--to", help="Highest.")] = None


@dataclasses.dataclass(frozen=True)
class Where:
    workers: int = 1


def _app(given):
    @grouped
    def command(
        name: Annotated[str, typer.Argument()] = "all",
        box: Box = Box(),
        seed: int = 0,
        where: Where = Where(),
    ) -> None:
        """What it does."""
        given.append((name, box, seed, where))

    app = typer.Typer(add_completion=False)
    app.command()(command)
    return app


def test_groups_arrive_whole_and_with_their_defaults():
    given = []
    app = _app(given)
    for line in ([], ["one", "--to", "2.5", "--workers", "3"]):
        assert CliRunner().invoke(app, line).exit_code == 0
    assert given == [
        ("all", Box(), 0, Where()),
        ("one", Box(0.0, 2.5), 0, Where(3)),
    ]


def test_help_lists_fields_in_the_order_of_the_signature():
    found = CliRunner().invoke(_app([]), ["--help"], env={"COLUMNS": "100"})
    places = [found.stdout.index(f"--{o}") for o in ("from", "to", "seed", "workers")]
    assert places == sorted(places)
    assert "What it does." in found.stdout and "Highest." in found.stdout


def test_a_wrong_value_is_refused_by_its_option():
    given = []
    found = CliRunner().invoke(_app(given), ["--to", "far"])
    assert found.exit_code == 2 and "--to" in found.output and not given
