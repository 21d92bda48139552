"""Fit restitution laws to all recorded impacts."""

import dataclasses
import re
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Float

from ..hybrid.programs import program
from ..models import ConstantRestitution, LinearInSpeed, PowerLawRestitution
from ..recordings import RecordingError, Segments


# Residuals beyond this many standard errors count linearly, not quadratically (Huber)
_HUBER = 3.0
# Largest decrease of the cost predicted for a further step at an optimum: such a step
# changes no parameter by more than a tenth of its standard error
_GRADIENT = 1e-2
# Ratio of high to low approach speeds below which impacts show little about how
# restitution depends on speed
RANGE = 1.5
# Quantiles of the speeds that are compared, because the slowest are inaccurate
_LOW, _HIGH = 0.05, 0.95


@dataclasses.dataclass(frozen=True)
class RestitutionFit:
    """A restitution law fitted to measured impacts.

    Examples:
        >>> from jaxcam.fitting import impact_law
        >>> from jaxcam.recordings import ImpactTable
        >>> speed = np.array([1.0, 1.5, 2.0, 2.5, 3.0])
        >>> scatter = np.array([1e-3, -1e-3, 2e-3, -2e-3, 1e-3])
        >>> law = impact_law(ImpactTable("drops", speed, 0.8 * speed + scatter))
        >>> round(float(law.laws["constant"].values[0]), 2)
        0.8
    """

    law: eqx.Module
    """The fitted law, a module that can be passed to `CamFollower(restitution=...)`."""
    names: tuple[str, ...]
    """Names of the fitted parameters of the law."""
    values: Float[np.ndarray, " p"]
    """Fitted values, in the order of `names`."""
    stderr: Float[np.ndarray, " p"]
    """Standard errors of `values`."""
    cost: float
    """Sum of squared residuals in units of the standard errors, with Huber's loss
    function.
    """
    freedom: int
    """Number of impacts minus number of parameters."""
    converged: bool
    """Whether the fit ended at an optimum. If not, `values` and `stderr` mean nothing.
    """

    @property
    def reduced_cost(self) -> float:
        """`cost / freedom`: about 1 if the law explains all impacts."""
        return self.cost / max(1, self.freedom)

    def sentence(self) -> str:
        """Return the law in words, and whether its fit failed."""
        parts = ", ".join(
            f"{n} = {v:.5g} +- {e:.1g}"
            for n, v, e in zip(self.names, self.values, self.stderr)
        )
        name = re.sub("(?<=[a-z])(?=[A-Z])", " ", type(self.law).__name__)
        found = (
            f"{name.capitalize()}: {parts}; {self.freedom + len(self.names)} impacts, "
            f"reduced cost {self.reduced_cost:.2f} (1 if only noise remains)."
        )
        if self.converged:
            return found
        return f"{found} This fit did not converge; start it from other values."


def restitution_laws(segments: Sequence[Segments]) -> dict[str, RestitutionFit]:
    """Fit three restitution laws to the impacts in recordings.

    Args:
        segments: The segmented recordings.

    Returns:
        The laws `"constant"`, `"speed"` (linear in the speed of the drive; thesis,
            Figure 4.15) and `"approach"` (a power of the approach speed); laws with
            undetermined parameters are omitted, and the last one if all approach speeds
            are similar.

    Raises:
        RecordingError: There are too few impacts.

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.fitting import restitution_laws
        >>> from jaxcam.recordings import read_case, read_rig, segment_case
        >>> parts = segment_case(read_case(DEMO_RIG), read_rig(DEMO_RIG / "rig.toml"))
        >>> "constant" in restitution_laws(parts)
        True
    """
    approach = np.concatenate([part.impacts.approach for part in segments])
    usual = float(np.median(approach[approach > 0])) if np.any(approach > 0) else 1.0
    start = {
        "constant": (ConstantRestitution(0.5), ("r",)),  # pyright: ignore
        "speed": (LinearInSpeed(0.0, 0.5), ("slope", "intercept")),  # pyright: ignore
        "approach": (
            PowerLawRestitution(0.5, usual, 0.0),  # pyright: ignore
            ("r0", "exponent"),
        ),
    }
    speeds = {part.drive.speed for part in segments if part.drive is not None}
    if len(speeds) < 2:
        del start["speed"]
    clear = approach[approach > 0]
    if len(clear) and np.quantile(clear, _HIGH) < RANGE * np.quantile(clear, _LOW):
        del start["approach"]
    found = {}
    for name, (law, names) in start.items():
        try:
            found[name] = fit_restitution(segments, law, names)
        except np.linalg.LinAlgError:
            # the impacts do not determine a combination of its parameters
            continue
    return found


def fit_restitution(
    segments: Sequence[Segments], law: eqx.Module, names: Sequence[str]
) -> RestitutionFit:
    """Fit parameters of a restitution law to the speeds before and after every impact.

    The misfit of an impact is its separation speed minus the coefficient of restitution
    times its approach speed, divided by the standard error of this difference, to which
    both speeds and the surface speed contribute. The method is Levenberg-Marquardt
    (optimistix) with Huber's loss function, which is linear for outliers.

    Args:
        segments: Segments from `segment_case` or `segment`.
        law: Initial law, called as `law(speed, approach_speed)`.
        names: Fields of the law to fit; the others are not changed.

    Returns:
        A [`jaxcam.fitting.RestitutionFit`][].

    Raises:
        RecordingError: There are fewer impacts than parameters.

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.fitting import fit_restitution
        >>> from jaxcam.models import ConstantRestitution
        >>> from jaxcam.recordings import read_case, read_rig, segment_case
        >>> parts = segment_case(read_case(DEMO_RIG), read_rig(DEMO_RIG / "rig.toml"))
        >>> found = fit_restitution(parts, ConstantRestitution(0.5), ["r"])
        >>> bool(0 < found.values[0] < 1)
        True
    """
    impacts = [part.impacts for part in segments]
    speed = np.concatenate(
        [
            np.full(i.count, part.drive.speed if part.drive is not None else 0.0)
            for i, part in zip(impacts, segments)
        ]
    )
    columns = [
        np.concatenate([getattr(i, name) for i in impacts])
        for name in (
            "approach",
            "separation",
            "before_stderr",
            "after_stderr",
            "surface_stderr",
        )
    ]
    data = np.stack([speed, *columns])
    fine = np.all(np.isfinite(data), axis=0) & (columns[0] > 3 * columns[2])
    data = data[:, fine]
    if data.shape[1] <= len(names):
        raise RecordingError(
            f"There are only {data.shape[1]} clear impacts for {len(names)} "
            f"restitution parameters; give more recordings, or a simpler law."
        )
    return fit_rows(data, law, names)


def fit_rows(
    data: Float[np.ndarray, "6 k"], law: eqx.Module, names: Sequence[str]
) -> RestitutionFit:
    """Fit parameters of a law to impacts given as arrays.

    **Arguments:** the rows of `data` are the speed of the drive, the approach speed,
    the separation speed, and the standard errors of the approach, separation and
    surface speeds; `law` and `names` are those of `fit_restitution`.
    """
    names = tuple(names)
    start = np.array([float(getattr(law, name)) for name in names])
    found = _solve(law, names, jnp.asarray(start), jnp.asarray(data))
    rows, off = map(np.asarray, _normal(law, names, found, jnp.asarray(data)))
    covariance = np.linalg.inv(rows.T @ rows)
    # the verdict of the optimiser is about the last step, which may be small because
    # the steps before it failed
    score = rows.T @ off
    promise = score @ covariance @ score
    values = np.asarray(found)
    return RestitutionFit(
        _with(law, names, jnp.asarray(values)),
        names,
        values,
        np.sqrt(np.diag(covariance)),
        float(np.sum(off**2)),
        int(data.shape[1] - len(names)),
        bool(promise < _GRADIENT),
    )


def _with(law, names, values):
    return eqx.tree_at(
        lambda l: tuple(getattr(l, name) for name in names),
        law,
        tuple(values[k] for k in range(len(names))),
    )


def _misfit(values, data, law, names):
    """Return the misfit of each impact in standard errors, `(k,)`."""
    speed, approach, separation, before, after, surface = data
    changed = _with(law, names, values)
    r = jax.vmap(changed)(speed, approach)
    error = jnp.sqrt(after**2 + (r * before) ** 2 + ((1 + r) * surface) ** 2)
    # the error is a weight, so it must not depend on the parameters
    return (separation - r * approach) / jax.lax.stop_gradient(error)


def _huber(off):
    """Return the square root of twice Huber's loss, with the sign of the misfit."""
    size = jnp.abs(off)
    safe = jnp.where(size > _HUBER, size, _HUBER)
    return jnp.where(
        size > _HUBER, jnp.sign(off) * jnp.sqrt(2 * _HUBER * safe - _HUBER**2), off
    )


@program
def _solve(law, names, start, data):
    def loss(values, data):
        return _huber(_misfit(values, data, law, names))

    solver = optx.LevenbergMarquardt(rtol=1e-10, atol=1e-12)
    found = optx.least_squares(loss, solver, start, data, max_steps=200, throw=False)
    return found.value


@program
def _normal(law, names, values, data):
    def loss(values):
        off = _huber(_misfit(values, data, law, names))
        return off, off

    return jax.jacfwd(loss, has_aux=True)(values)
