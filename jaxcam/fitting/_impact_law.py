"""Fit a restitution law to a table of impacts, and check momentum conservation."""

import dataclasses
from typing import Any

import numpy as np
import scipy.stats
from jaxtyping import Bool, Float

from ..models import ConstantRestitution, PowerLawRestitution
from ..recordings import ImpactTable, RecordingError
from ._momentum import momentum_of, MomentumBalance
from ._restitution import fit_rows, RANGE, RestitutionFit


# Minimum number of impacts from which a law and its scatter can be estimated
_LEAST = 4
# An impact that deviates from the law by more than this many standard deviations is an
# outlier
_MISREAD = 6.0
# Significance level of the F test: probability that a constant coefficient is taken for
# one that depends on the speed
_CHANCE = 0.01
# If fewer than this fraction of the impacts would remain, no outlier is excluded
_MAJORITY = 0.7
# standard deviation of a Gaussian variable, divided by the median of its absolute value
_MAD = 1.4826
# A constant law whose mean squared residual is below this fraction of the squared
# scatter counts as exact
_NOTHING = 1e-4


@dataclasses.dataclass(frozen=True)
class ImpactLaw:
    """The restitution law of a table of impacts.

    Examples:
        >>> from jaxcam.fitting import impact_law
        >>> from jaxcam.recordings import ImpactTable
        >>> speed = np.array([1.0, 1.5, 2.0, 2.5, 3.0])
        >>> scatter = np.array([1e-3, -1e-3, 2e-3, -2e-3, 1e-3])
        >>> found = impact_law(ImpactTable("drops", speed, 0.8 * speed + scatter))
        >>> found.set_aside
        ()
    """

    table: ImpactTable
    """The table of impacts."""
    laws: dict[str, RestitutionFit]
    """The fitted laws: `"constant"`, and the power law as `"falling"` or `"rising"`."""
    best: str
    """Name of the law that the impacts support."""
    delta_bic: dict[str, float]
    """BIC of each law minus that of the constant law; negative is better. For the power
    law in the other direction, which fits no better than the constant one, the
    difference is the penalty for one extra parameter.
    """
    p_value: float
    """p-value of the F test of the power law against a constant coefficient."""
    scatter: float
    """Standard deviation of individual impacts, in `scatter_unit`."""
    scatter_unit: str
    """Unit of the scatter: that of the speed, `"1"` for the restitution, or `"stated"`
    for the standard errors in the table.
    """
    set_aside: tuple[int, ...]
    """Rows that are outliers, counted from 1."""
    momentum: MomentumBalance | None
    """Momentum balance of two bodies, or `None`."""

    @property
    def law(self) -> RestitutionFit:
        """The law that the impacts support."""
        return self.laws[self.best]

    def sentences(self) -> list[str]:
        """Return sentences on the law and its certainty, and remarks on the table."""
        return [self._headline(), *self._caveats()]

    def _headline(self) -> str:
        table, law = self.table, self.law
        kept = len(table) - len(self.set_aside)
        count = f"{kept} impacts of {table.name}"
        if self.best == "constant":
            r, error = law.values[0], law.stderr[0]
            other = next((name for name in self.laws if name != "constant"), None)
            against = (
                ""
                if other is None
                else f" ({other} with speed: p = {self.p_value:.2g}, delta BIC "
                f"{self.delta_bic[other]:+.1f})"
            )
            return (
                f"Restitution is constant over the {count}: {r:.4g} +- "
                f"{error:.1g}{against}."
            )
        slow, fast = np.quantile(table.approach, (0.05, 0.95))
        ends = [float(law.law(0.0, speed)) for speed in (slow, fast)]  # pyright: ignore
        r0, exponent = law.values
        v_ref = float(law.law.reference_speed)  # pyright: ignore
        verb = "falls" if self.best == "falling" else "rises"
        return (
            f"Restitution {verb} with speed over the {count}, from {ends[0]:.3g} at "
            f"{slow:.3g} {table.unit} to {ends[1]:.3g} at {fast:.3g} {table.unit}: "
            f"r = r0 (1 + v / {v_ref:.4g} {table.unit})^-b with r0 = {r0:.4g} +- "
            f"{law.stderr[0]:.1g} and b = {exponent:.3g} +- {law.stderr[1]:.1g} "
            f"(p = {self.p_value:.2g}, delta BIC {self.delta_bic[self.best]:+.1f} "
            f"relative to a constant)."
        )

    def _caveats(self) -> list[str]:
        table, found = self.table, list(self.table.notes)
        if self.scatter_unit == "stated":
            found.append(
                f"The scatter is {self.scatter:.2g} times the stated standard errors."
            )
        elif self.scatter_unit == "1":
            found.append(
                f"The coefficient of restitution scatters by {self.scatter:.2g}."
            )
        else:
            found.append(
                f"The speed after an impact scatters by {self.scatter:.2g} "
                f"{self.scatter_unit}."
            )
        if self.set_aside:
            rows = ", ".join(map(str, self.set_aside))
            found.append(f"Excluded as an outlier: row {rows}; check the table.")
        span = float(np.max(table.approach) / np.min(table.approach))
        if span < RANGE:
            found.append(
                f"The fastest impact is only {span:.2f} times as fast as the slowest: "
                f"this shows little about how restitution depends on speed."
            )
        r = float(np.median(table.separation / table.approach))
        if r > 1:
            found.append(
                f"The bodies separate {r:.2f} times as fast as they approach; check "
                f"whether the columns before and after are interchanged."
            )
        lost = [name for name, law in self.laws.items() if not law.converged]
        if lost:
            found.append(
                f"The fit of the {' and the '.join(lost)} law did not converge; check "
                f"the impacts in the table, or add more."
            )
        if self.momentum is not None:
            found.append(self.momentum.sentence())
        return found

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers and strings."""
        return {
            "table": self.table.name,
            "impacts": len(self.table),
            "law": self.best,
            "parameters": {
                name: {"value": float(value), "stderr": float(error)}
                for name, value, error in zip(
                    self.law.names, self.law.values, self.law.stderr
                )
            },
            "delta_bic": self.delta_bic,
            "p_value": self.p_value,
            "scatter": {"value": self.scatter, "unit": self.scatter_unit},
            "set_aside": list(self.set_aside),
            "momentum": None if self.momentum is None else self.momentum.to_json(),
            "sentences": self.sentences(),
        }


def impact_law(table: ImpactTable) -> ImpactLaw:
    """Return the restitution law that a table of impacts supports.

    A constant coefficient of restitution r and a power law, r = r0 (1 + v / v_ref)^-b
    with the approach speed v and its median v_ref, are fitted by least squares. The
    scatter of individual impacts is estimated from the data: either the separation
    speed or the coefficient of restitution is assumed to have a constant standard
    deviation, whichever is more likely. If the table states standard errors, the
    scatter is assumed to be proportional to them. The power law is chosen if an F test
    rejects a constant coefficient at the 1 % level.

    Args:
        table: The impacts.

    Returns:
        An [`jaxcam.fitting.ImpactLaw`][].

    Raises:
        RecordingError: There are fewer than four impacts.

    Examples:
        >>> from jaxcam.fitting import impact_law
        >>> from jaxcam.recordings import ImpactTable
        >>> speed = np.array([1.0, 1.5, 2.0, 2.5, 3.0])
        >>> scatter = np.array([1e-3, -1e-3, 2e-3, -2e-3, 1e-3])
        >>> impact_law(ImpactTable("drops", speed, 0.8 * speed + scatter)).best
        'constant'
    """
    if len(table) < _LEAST:
        raise RecordingError(
            f"{table.name}: there are only {len(table)} impacts; at least {_LEAST} are "
            f"needed for a law and its standard error."
        )
    weights = _weights(table)
    every = np.ones(len(table), dtype=bool)
    kept = {name: _sound(table, one) for name, one in weights.items()}
    # the likelihoods are comparable only if every kind of scatter uses the same rows
    some = np.any(list(kept.values()), axis=0)
    kind = max(weights, key=lambda name: _likelihood(table, weights[name], some))
    keep = kept[kind]
    if np.sum(keep) < max(_LEAST, _MAJORITY * len(table)):
        keep = every
    return _chosen(table, kind, weights[kind], keep)


def _weights(table: ImpactTable) -> dict[str, Float[np.ndarray, " k"]]:
    """Return the relative scatter of the impacts for each unit that `scatter_unit` may
    have.
    """
    if table.approach_stderr is None and table.separation_stderr is None:
        return {table.unit: np.ones(len(table)), "1": table.approach}
    r = float(np.median(table.separation / table.approach))
    zero = np.zeros(len(table))
    before = zero if table.approach_stderr is None else table.approach_stderr
    after = zero if table.separation_stderr is None else table.separation_stderr
    return {"stated": np.hypot(after, r * before)}


def _fits(table: ImpactTable, errors, keep) -> dict[str, RestitutionFit]:
    """Fit both laws to the impacts selected by `keep`."""
    zero = np.zeros(len(table))
    rows = (zero, table.approach, table.separation, zero, errors, zero)
    data = np.stack(rows)[:, keep]
    start = float(np.median(table.separation / table.approach))
    usual = float(np.median(table.approach))
    constant = ConstantRestitution(start)  # pyright: ignore
    power = PowerLawRestitution(start, usual, 0.0)  # pyright: ignore
    found = {"constant": fit_rows(data, constant, ("r",))}
    if np.ptp(table.approach[keep]) > 1e-6 * usual:
        found["power"] = fit_rows(data, power, ("r0", "exponent"))
    return found


def _sound(table: ImpactTable, weights) -> Bool[np.ndarray, " k"]:
    """Return whether each row fits the more general law, that is, is not an outlier."""
    every = np.ones(len(table), dtype=bool)
    typical = _typical(_off(table, np.median(_r(table))) / weights, table, weights)
    off = np.zeros(len(table))
    for _ in range(3):
        off = _misfit(table, weights * typical, every) * typical
        typical = _typical(off, table, weights)
    return np.abs(off) <= _MISREAD * typical


def _typical(off, table: ImpactTable, weights) -> float:
    """Return a robust estimate of the scatter; at least the size of rounding errors."""
    least = 1e-9 * float(np.max(table.separation / weights)) + 1e-300
    return max(_MAD * float(np.median(np.abs(off))), least)


def _misfit(table: ImpactTable, errors, keep):
    """Return the misfit of each impact to the more general law, in standard errors."""
    fits = _fits(table, errors, keep)
    law = fits.get("power", fits["constant"]).law
    r = np.array([float(law(0.0, v)) for v in table.approach])  # pyright: ignore
    return _off(table, r) / errors


def _likelihood(table: ImpactTable, weights, keep) -> float:
    """Return the log-likelihood for Gaussian scatter proportional to the weights."""
    scale = _typical(_misfit(table, weights, keep)[keep], table, weights)
    off = _misfit(table, weights * scale, keep)[keep] * scale
    size = max(float(np.sqrt(np.mean(off**2))), 1e-300)
    return -float(np.sum(np.log(size * weights[keep])))


def _r(table: ImpactTable):
    return table.separation / table.approach


def _off(table: ImpactTable, r):
    return table.separation - r * table.approach


def _chosen(table: ImpactTable, kind: str, weights, keep) -> ImpactLaw:
    count = int(np.sum(keep))
    scale = 1.0
    # the scatter is estimated from the residuals of the more general law
    for _ in range(3):
        fits = _fits(table, weights * scale, keep)
        most = fits.get("power", fits["constant"])
        scale *= max(np.sqrt(most.cost / most.freedom), 1e-12)
        scale = max(scale, 1e-12 * float(np.max(table.separation / weights)) + 1e-300)
    fits = _fits(table, weights * scale, keep)
    constant, power = fits["constant"], fits.get("power")
    laws, delta, p_value, best = {"constant": constant}, {"constant": 0.0}, 1.0, ""
    if power is not None:
        direction = "falling" if power.values[1] > 0 else "rising"
        other = "rising" if direction == "falling" else "falling"
        laws[direction] = power
        # if the constant law is exact, the power law cannot improve the fit
        nothing = constant.cost <= _NOTHING * count
        ratio = 1.0 if nothing else constant.cost / max(power.cost, 1e-300)
        extra = float(np.log(count))
        delta |= {direction: extra - count * float(np.log(ratio)), other: extra}
        f = max(ratio - 1.0, 0.0) * power.freedom
        p_value = float(scipy.stats.f.sf(f, 1, power.freedom))
        if p_value < _CHANCE and delta[direction] < 0:
            best = direction
    aside = tuple(int(row) + 1 for row in np.flatnonzero(~keep))
    return ImpactLaw(
        table,
        laws,
        best or "constant",
        delta,
        p_value,
        float(scale),
        kind,
        aside,
        momentum_of(table, keep),
    )
