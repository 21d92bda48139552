"""Warn of corners in the functions of a user's system."""

import numpy as np
import typer

from ..hybrid import HybridSystem


# functions that are integrated; a corner in an impact law does no harm
_INTEGRATED = ("vector_field", "branch", "gap")
# Maximum number of corners listed
_MOST = 3


def warn_of_corners(system: HybridSystem) -> None:
    """Print a warning on standard error if a system from a user's file is not smooth.

    A simulation is less accurate near a corner that is not declared, so labels, orbits
    and fits can be wrong there.
    """
    from ..discrepancy.terms import WithTerms
    from ..fitting.own_systems import system_source
    from ..hybrid import corners

    base = system.base if isinstance(system, WithTerms) else system
    if system_source(type(base)) is None:
        return
    try:
        found = corners(base, np.zeros(len(base.state_names)))
    except Exception:
        # whatever is wrong with the functions is reported by the command itself
        return
    found = [corner for corner in found if corner.function in _INTEGRATED]
    if not found:
        return
    for corner in found[:_MOST]:
        typer.echo(f"Warning: {corner}.", err=True)
    more = len(found) - _MOST
    others = f" There are {more} more such places." if more > 0 else ""
    typer.echo(
        f"Near such a place, labels, orbits and fits can be wrong.{others}", err=True
    )
