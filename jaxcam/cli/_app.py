"""The commands of `jaxcam` and its global options."""

import gc
import os
import sys
from typing import Annotated

import typer

from ._basins import basins
from ._continue import continue_
from ._demo import demo
from ._diagnose import diagnose
from ._diagram import diagram
from ._errors import INTERRUPTED, one_sentence
from ._fit import fit
from ._new_rig import new_rig
from ._reproduce import reproduce
from ._simulate import simulate


# numbers of new objects, and of collections of younger objects, between collections
_COLLECTED = (50_000, 20, 50)

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    # an ordinary Python traceback is easier to include in a bug report
    pretty_exceptions_enable=False,
)
app.command()(one_sentence(simulate))
app.command()(one_sentence(diagram))
app.command()(one_sentence(basins))
app.command("continue")(one_sentence(continue_))
app.command()(one_sentence(demo))
app.command()(one_sentence(diagnose))
app.command()(one_sentence(fit))
app.command("new-rig")(one_sentence(new_rig))
app.command()(one_sentence(reproduce))


def _version(wanted: bool) -> bool:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"jaxcam {version('jaxcam')}")
        raise typer.Exit()
    return wanted


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """
    Simulate, continue, fit and diagnose vibro-impact systems.

    \b
    Examples:
      jaxcam demo
      jaxcam simulate cam-follower --speed 140
    """
    del version


def main() -> None:
    """Run the command given by the process arguments."""
    # tracing programs creates many objects, nearly all of which are kept; searching
    # them for garbage at the usual intervals takes a sixth of the time
    usual = gc.get_threshold()
    gc.set_threshold(*_COLLECTED)
    try:
        app()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            # exit at once, because pending XLA computations would crash the interpreter
            # during an orderly shutdown
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(INTERRUPTED)
        raise
    finally:
        gc.set_threshold(*usual)
