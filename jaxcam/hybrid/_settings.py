"""Accuracy settings of a run."""

from typing import Literal

import diffrax
import equinox as eqx
import jax
import numpy as np
from jaxtyping import ArrayLike, Float

from ..parameters import FloatScalar


class Settings(eqx.Module):
    """Accuracy settings of a run; they do not change the physics.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> settings = jaxcam.Settings(tolerance=1e-8)
        >>> ball = BouncingBall()
        >>> run = jaxcam.simulate(ball, [1.0, 0.0], 0.0, 1.0, settings=settings)
        >>> bool(run.successful)
        True
    """

    tolerance: FloatScalar = 1e-10
    """Relative error allowed per step. The error of each component is relative to the
    distance that the component has moved since the start of the run; at first, the
    error is relative to the distance from the constraint if a gap depends on the
    component, otherwise to the magnitude of the component. The accuracy is therefore
    independent of the units and of the origin of a coordinate. However, a coordinate is
    resolved only to 1e-15 of its value, which limits the resolution of a small gap far
    from the origin.
    """
    chatter_smallness: FloatScalar = 1e-3
    """Chatter is completed analytically only if lambda/(1 - r) is below this value,
    with lambda = u |j| / a^2 for rebound speed u, jerk j, normal acceleration a and
    coefficient of restitution r. The relative error of the completed time is about the
    square of this value.
    """
    chatter_depth: FloatScalar = 1e-6
    """Chatter is completed analytically only after the speed has fallen to this
    fraction of the fastest rebound since the last release, or if the impacts can no
    longer be resolved in floating point. With 1, chatter is completed as soon as the
    theory allows (fast, for sweeps); with smaller values, more impacts of each sequence
    are listed.
    """
    solver: diffrax.AbstractSolver = eqx.field(
        default_factory=diffrax.Dopri8, static=True
    )
    """Explicit Runge-Kutta solver of diffrax with an error estimate."""
    absolute: FloatScalar | Float[ArrayLike, " n"] | None = None
    """Absolute error allowed, in units of the state: one number, or one per component,
    shape `(n,)`. It replaces the scale described under `tolerance`: the allowed error
    becomes `absolute + tolerance * |state|`.
    """
    max_step: FloatScalar | None = None
    """Longest integration step (s). A force or barrier that is narrower than a step can
    be stepped over: set this if forces are brief, or declare their times as
    [`jaxcam.hybrid.HybridSystem.breakpoints`][]. By default, a step is at most a
    quarter of the system's period; without a period, it is at most 1/64 of the run
    while the error estimate is uninformative (at rest, or in a uniform field).
    """
    plain: bool = eqx.field(default=False, static=True)
    """Run the event loop without the compiler passes of `jaxcam.hybrid.lowering`. This
    is about ten times slower, gives the same result within the tolerance, and has no
    reverse mode. It serves as a check of these passes, and as a fallback if one fails.
    """

    backend: Literal["auto", "llvm", "xla", "cuda"] = eqx.field(
        default="auto", static=True
    )
    """Compiler for runs that are not traced: `"llvm"`, which is faster but rejects a
    system with an unsupported operation; `"xla"`, which is also used for all traced
    runs and derivatives; or `"auto"`, which is LLVM if JAX runs on the CPU and LLVM
    supports the system, otherwise XLA. With `"cuda"`, batches
    ([`jaxcam.hybrid.stroboscope`][], sweeps, basins) run on an NVIDIA GPU, with one
    thread for each trajectory, and all other runs are as with `"llvm"`. Results of the
    backends differ by rounding error or, where a function is not smooth, by the
    tolerance.
    """

    @property
    def compiles(self) -> bool:
        """Return whether runs that are not traced are compiled by LLVM."""
        if self.plain or self.backend == "xla":
            return False
        return self.demands or jax.default_backend() == "cpu"

    @property
    def demands(self) -> bool:
        """Return whether a run that LLVM cannot compile raises an error."""
        return self.backend in ("llvm", "cuda")

    @property
    def on_gpu(self) -> bool:
        """Return whether batches run on a GPU."""
        return self.compiles and self.backend == "cuda"

    def check(self) -> None:
        """Raise `ValueError` if a setting is outside its range.

        Raises:
            ValueError: A setting is outside its range.
        """
        if self.backend not in ("auto", "llvm", "xla", "cuda"):
            raise ValueError(
                f'backend is {self.backend!r}; choose "auto", "llvm", "xla" or "cuda"'
            )
        if self.plain and self.demands:
            raise ValueError(
                f"plain=True runs with XLA, but backend is {self.backend!r}; omit one "
                "of them"
            )
        if not 0 < float(self.tolerance) < 1:
            raise ValueError(
                f"tolerance is {float(self.tolerance):g}; give a number between 1e-14 "
                "and 1e-2, such as 1e-10"
            )
        if not 0 < float(self.chatter_smallness) <= 0.1:
            raise ValueError(
                f"chatter_smallness is {float(self.chatter_smallness):g}; completion "
                "of chatter requires a value in (0, 0.1], such as 1e-3"
            )
        if not 0 < float(self.chatter_depth) <= 1:
            raise ValueError(
                f"chatter_depth is {float(self.chatter_depth):g}; give a value in "
                "(0, 1]"
            )
        if self.absolute is not None and not np.all(
            np.isfinite(self.absolute) & (np.asarray(self.absolute) > 0)
        ):
            raise ValueError(
                f"absolute is {self.absolute}; give positive numbers in units of the "
                "state, or omit it"
            )
        if self.max_step is not None and not float(np.asarray(self.max_step)) > 0:
            raise ValueError(
                f"max_step is {float(np.asarray(self.max_step)):g}; give a positive "
                "step length in seconds"
            )
