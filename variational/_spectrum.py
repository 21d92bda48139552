"""Lyapunov exponents and their standard errors."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid.record import Printed
from jaxcam.tables import ShortTable


class LyapunovSpectrum(Printed):
    """Lyapunov exponents (1/s), with one set per motion if there are several."""

    exponents: Float[Array, "*lanes n"]
    """Exponents, largest first, shape `(n,)` or `(motions, n)`."""
    stderr: Float[Array, "*lanes n"]
    """Standard error of each exponent: the larger of two estimates. The first is the
    scatter of blocks of consecutive periods. The second is the oscillation of the
    accumulated growth about a straight line, divided by the duration; it depends on the
    final orientation of the frame. Near a periodic orbit with a complex pair of
    multipliers, the frame rotates with the pair, and the error decreases only in
    inverse proportion to the duration.
    """
    impact_rate: Float[Array, "*lanes"]
    """Mean number of impacts per second."""
    local: Float[Array, "*lanes turns n"]
    """Finite-time exponents over each period, shape `(turns, n)`."""
    state: Float[Array, "*lanes n"]
    """Final state, from which the computation can be continued, shape `(n,)`."""
    turn: Float[Array, "*lanes"] | Float[Array, "1"]
    """Length of a period (s); shape `(1,)` if it is the same for all motions."""
    code: Array
    """0 if every period was completed; otherwise an index into `RESULTS`, and the
    exponents are NaN.
    """

    @property
    def running(self) -> Float[Array, "*lanes turns n"]:
        """The exponents over the first 1, 2, ... periods, to check convergence."""
        number = self.local.shape[-2]
        count = jnp.arange(1.0, number + 1)[:, None]
        return jnp.cumsum(self.local, axis=-2) / jnp.broadcast_to(
            count, self.local.shape
        )

    def _table(self) -> ShortTable:
        value, error = np.asarray(self.exponents), np.asarray(self.stderr)
        turns, rate = self.local.shape[-2], np.asarray(self.impact_rate)
        if value.ndim == 1:
            sentence = (
                f"Lyapunov exponents over {turns} periods; sum {value.sum():.6g} 1/s, "
                f"{float(rate):.6g} impacts/s."
            )
            headings = ("", "exponent (1/s)", "standard error")
            rows = [
                (str(k + 1), f"{one:.6g}", f"{err:.1g}")
                for k, (one, err) in enumerate(zip(value, error))
            ]
            return ShortTable(sentence, headings, rows)
        sentence = f"Lyapunov exponents of {len(value)} motions over {turns} periods."
        headings = ("motion", "largest (1/s)", "standard error", "sum", "impacts/s")
        rows = [
            (
                str(k),
                f"{one[0]:.6g}",
                f"{err[0]:.1g}",
                f"{one.sum():.6g}",
                f"{hits:.6g}",
            )
            for k, (one, err, hits) in enumerate(zip(value, error, rate))
        ]
        return ShortTable(sentence, headings, rows)


def standard_error(
    local: Float[np.ndarray, "lanes turns n"], blocks: int
) -> Float[np.ndarray, "lanes n"]:
    """Return the standard error of the mean of finite-time exponents.

    The scatter of blocks is too small if the accumulated growth oscillates and a block
    is nearly a whole number of oscillations long. The oscillation itself, with a root
    mean square `s`, makes the difference between the ends of the run `sqrt(2) s`.
    """
    lanes, turns, n = local.shape
    size = turns // blocks
    means = local[:, : size * blocks].reshape(lanes, blocks, size, n).mean(axis=2)
    with np.errstate(invalid="ignore"):
        scatter = means.std(axis=1, ddof=1) / np.sqrt(blocks)
        grown = np.cumsum(local - local.mean(axis=1, keepdims=True), axis=1)
        ends = np.sqrt(2) * grown.std(axis=1) / turns
    error = np.maximum(scatter, ends)
    return np.where(np.isneginf(local).any(axis=1), 0.0, error)
