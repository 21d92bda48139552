"""Keep the messages of XLA's compiler away from the terminal of the command line."""

import os
import sys
from pathlib import PurePath


def silence_xla() -> None:
    """Silence XLA's log if this process is the command line; a level that the user has
    set takes precedence.

    XLA reads the level when jax is imported.
    """
    if _is_command_line(sys.argv, sys.orig_argv):
        os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")


def _is_command_line(words: list[str], interpreter: list[str]) -> bool:
    """Return whether a process runs `jaxcam` or `python -m jaxcam`.

    **Arguments:** `sys.argv` and `sys.orig_argv`, during the import of the package.
    """
    if not words or words[0] != "-m":
        # the name of the script ends with .exe on Windows
        return bool(words) and PurePath(words[0]).stem == "jaxcam"
    after = interpreter[interpreter.index("-m") + 1 :] if "-m" in interpreter else []
    return after[:1] in (["jaxcam"], ["jaxcam.cli"])
