"""Convert exceptions to one sentence on standard error and an exit code."""

import functools
from collections.abc import Callable, Mapping
from typing import ParamSpec, TypeVar

import typer

from ._lock import release


_P = ParamSpec("_P")
_R = TypeVar("_R")

BAD_INPUT = 2
STOPPED_EARLY = 1
INTERRUPTED = 130

# messages for Python users name arguments; on the command line, these are options
_OPTIONS = (
    ("or pass state=None to start", "or give --state release to start"),
    ("state=None needs", "a start at the release point needs"),
    ("pass the state to start from", "give the state to start from with --state"),
    ("pass the states to start from", "give a state to start from, as in --state 0,0"),
    (
        "pass Stroboscopic(system, period=...) with a period in seconds",
        "give the class a `period` property, or use jaxcam.sweeps.Stroboscopic(system, "
        "period=...) in Python",
    ),
    ('engine="diffeqsolve"', "--engine diffeqsolve"),
    ("pass one (diffrax.Dopri8(), diffrax.Tsit5())", "choose --solver dopri8"),
    ('gaps="split"', "--gaps split"),
    ("pass resume=True", "give --resume"),
    ("with resume=True", "with --resume"),
)


def one_sentence(command: Callable[_P, _R]) -> Callable[_P, _R]:
    """Wrap a command so that invalid input leads to one sentence and an exit code."""

    @functools.wraps(command)
    def wrapper(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        try:
            return command(*args, **kwargs)
        except KeyboardInterrupt:
            fail(_interrupted(kwargs))
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError:
            # the program that reads the output has ended (jaxcam ... | head)
            raise
        except OSError as error:
            fail(_about_file(error))
            raise typer.Exit(BAD_INPUT) from None
        except ValueError as error:
            fail(str(error))
            raise typer.Exit(BAD_INPUT) from None
        finally:
            release()

    return wrapper


def _interrupted(options: Mapping[str, object]) -> str:
    """Return how to finish an interrupted command, given its options."""
    if "resume" in options and options.get("out") is not None:
        added = "run it again" if options["resume"] else "add --resume"
        again = f"{added} to continue from the stored results"
    else:
        again = "run the command again to finish"
    return f"Stopped by Ctrl-C before the end; {again}."


def fail(message: str) -> None:
    """Print one line on standard error."""
    line = " ".join(map(_shortened, message.split()))
    # control characters of a file or an argument must not reach the terminal
    line = "".join(c if c.isprintable() else "?" for c in line)
    for python, option in _OPTIONS:
        line = line.replace(python, option)
    typer.echo(line if line.endswith((".", "?")) else f"{line}.", err=True)


def _shortened(word: str) -> str:
    """Shorten an excessively long word of a message, such as a path."""
    return word if len(word) <= 300 else f"{word[:40]}...{word[-20:]}"


def _about_file(error: OSError) -> str:
    if error.filename is None or error.strerror is None:
        return str(error)
    reason = error.strerror[0].lower() + error.strerror[1:]
    return f"{error.filename}: {reason}; check the path and its permissions."
