"""Forces that are free functions of two arguments, with a Gaussian process prior.

They are sums of products of the functions of which functions of one argument are sums.
The kernel of the Gaussian process is the product of the kernels of both arguments.
"""

from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ._families import Family, free_basis
from ._fitted_function import FittedFunction
from ._free_function import pick_of, picked
from ._term import Motion


# Number of sines of an argument, and of pairs of harmonics of a phase, which also has a
# constant; one more coefficient represents a jump
_SINES, _PAIRS = 10, 4
_HARMONICS = 1 + 2 * _PAIRS
_MOST = _SINES + 1


class Bivariate(NamedTuple):
    """All functions of the arguments of two families."""

    first: Family
    second: Family

    @property
    def name(self) -> str:
        """Return location and arguments, such as `flight phase and position`."""
        return f"{self.first.name} and {self.second.argument}"

    @property
    def arguments(self) -> tuple[str, str]:
        """Return the names of both arguments."""
        return str(self.first.argument), str(self.second.argument)

    @property
    def shape(self) -> tuple[int, int]:
        """Return the number of coefficients of each argument."""
        return _count(self.first), _count(self.second)

    @property
    def places(self) -> tuple[int, ...]:
        """Return the indices of the coefficients that are used, among those of a
        `BivariateForce`.
        """
        one, other = self.shape
        return tuple(_MOST * i + j for i in range(one) for j in range(other))

    def prior_variances(self, count: int, length: float) -> Float[np.ndarray, " count"]:
        """Return the variances of the coefficients of a function of variance one."""
        one, other = (
            f.prior_variances(_sines(f) + 1, length)[: _count(f)] for f in self
        )
        found = np.outer(one, other).ravel()
        assert len(found) == count
        return found

    def basis(self, along, across) -> Float[np.ndarray, "n p"]:
        """Return the contribution of each coefficient at `n` pairs of arguments."""
        one, other = (
            free_basis(f, np.asarray(at), _sines(f) + 1)[:, : _count(f)]
            for f, at in zip(self, (along, across))
        )
        return (one[:, :, None] * other[:, None, :]).reshape(len(one), -1)


class Axis(eqx.Module):
    """One of the arguments: the angle whose multiples the functions depend on is
    `rate * argument + shift`, within the range of the argument.
    """

    rate: Float[Array, ""]
    shift: Float[Array, ""]
    low: Float[Array, ""]
    high: Float[Array, ""]
    picks: Float[Array, " a"]
    slip: Float[Array, ""]
    jumping: Float[Array, ""]
    periodic: Bool[Array, ""]

    @classmethod
    def of(cls, family: Family):
        # the first sine of a phase is a constant
        first = 1 if family.periodic else 0
        rates, shifts = family.waves(_sines(family))
        return cls(
            rates[first],
            jnp.zeros(()) if family.periodic else shifts[first],
            jnp.asarray(family.low),
            jnp.asarray(family.high),
            pick_of(family),
            jnp.asarray(family.slip),
            jnp.asarray(float(family.jumps)),
            jnp.asarray(family.periodic),
        )

    def argument(self, motion: Motion):
        return picked(self.picks, motion, motion.velocity)

    def functions(self, at) -> Float[Array, " k"]:
        """Return the functions of the argument, the jump last."""
        inside = jnp.where(self.periodic, at, jnp.clip(at, self.low, self.high))
        angle = self.rate * inside + self.shift
        # multiples of the angle by recurrence, because many sines compile slowly
        twice = 2 * jnp.cos(angle)
        sines = [jnp.zeros_like(angle), jnp.sin(angle)]
        cosines = [jnp.ones_like(angle), twice / 2]
        for _ in range(_SINES - 1):
            sines.append(twice * sines[-1] - sines[-2])
        for _ in range(_PAIRS - 1):
            cosines.append(twice * cosines[-1] - cosines[-2])
        of_phase = [*cosines, *sines[1 : _PAIRS + 1]]
        of_phase += [jnp.zeros_like(angle)] * (_SINES - _HARMONICS)
        chosen = jnp.where(self.periodic, jnp.stack(of_phase), jnp.stack(sines[1:]))
        return jnp.append(chosen, self.jumping * jnp.tanh(at / self.slip))


class BivariateForce(FittedFunction):
    """A free function of two arguments that is added to the acceleration.

    **Arguments:** `label` of the parameters; `coefficients` of the products of the
    functions of both arguments, row by row; both arguments.
    """

    name: ClassVar[str] = "bivariate_force"
    size: ClassVar[int] = _MOST**2
    label: str = eqx.field(static=True)
    coefficients: tuple[Array, ...] = eqx.field(
        converter=lambda values: tuple(jnp.asarray(x, dtype=float) for x in values)
    )
    first: Axis
    second: Axis

    @classmethod
    def of(cls, family: Bivariate, label: str, coefficients=None):
        """Return a function with given coefficients, zero by default."""
        return cls(
            label=label,
            coefficients=[0.0] * cls.size if coefficients is None else coefficients,
            first=Axis.of(family.first),
            second=Axis.of(family.second),
            motion_unit=family.first.motion_unit,
        )

    def acceleration(self, motion: Motion):
        one, other = (
            a.functions(a.argument(motion)) for a in (self.first, self.second)
        )
        return one @ jnp.stack(self.coefficients).reshape(_MOST, _MOST) @ other

    def slopes(self, along, across) -> Float[Array, " p"]:
        """Return the derivatives with respect to all coefficients."""
        one, other = self.first.functions(along), self.second.functions(across)
        return jnp.outer(one, other).ravel()


def _sines(family: Family) -> int:
    return _HARMONICS if family.periodic else _SINES


def _count(family: Family) -> int:
    """Return the number of functions of an argument."""
    return _sines(family) + int(family.jumps)
