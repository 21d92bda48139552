"""`jaxcam new-rig`: write an example of a user's system, to be edited."""

import keyword
import re
import shlex
from pathlib import Path
from typing import Annotated

import typer

from ..data import NEW_RIG
from ._output import write_text


# names in the example, to be replaced by those of the new rig
_FILE, _CLASS = "cart", "Cart"


def new_rig(
    name: Annotated[
        Path,
        typer.Argument(
            metavar="NAME", help=("Name of the rig; NAME.py and NAME.toml are written.")
        ),
    ],
) -> None:
    """
    Write a template for a rig of your own: a Python file and a rig file to edit.

    \b
    Examples:
      jaxcam new-rig two_stops
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name.name):
        raise ValueError(
            f"NAME is {name.name[:100]!r}; give a letter, followed by letters, digits, "
            "_ or -, such as two_stops."
        )
    if not name.parent.is_dir():
        raise ValueError(f"{name.parent}: there is no such folder; create it first.")
    files = {name.parent / f"{name.name}{kind}": kind for kind in (".py", ".toml")}
    for file in files:
        if file.exists():
            raise ValueError(f"{file} already exists; give another name.")
    for file, kind in files.items():
        text = (NEW_RIG / f"{_FILE}{kind}").read_text("utf-8")
        text = text.replace(f"{_FILE}.", f"{name.name}.")
        write_text(file, re.sub(rf"\b{_CLASS}\b", _class_name(name.name), text))
    code, rig = (shlex.quote(str(file)) for file in files)
    typer.echo(f"Written: {code} (the system) and {rig} (its rig file). Edit both.")
    typer.echo(f"Try it: jaxcam simulate --rig {rig} --state 0,0.8 --t1 3")
    typer.echo(
        f"With a folder CASE of recordings: jaxcam fit CASE --rig {rig}, then jaxcam "
        f"diagnose CASE --rig {rig} --out DIR"
    )


def _class_name(name: str) -> str:
    """Convert a file name to a class name, such as two_stops to TwoStops."""
    found = "".join(
        part[0].upper() + part[1:] for part in re.split("[_-]", name) if part
    )
    taken = keyword.iskeyword(found) or found == "HybridSystem"
    return f"{found}Rig" if taken else found
