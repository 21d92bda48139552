"""A force with an internal state, represented by time signals in each recording.

The measured position drives a hidden element through a known filter, so that its force
is a sum of known signals. The fit determines their strengths; the parameters of the
filter are fitted through the derivatives of the force with respect to them.
"""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...fitting import Parameter
from ._term import Motion, Term, terms_of


# signals with the same strengths in all recordings: outputs of the element, then the
# derivatives of its force with respect to its parameters
SHARED = 5
# signals of the free motion of the element, with separate strengths in each recording
STARTS = 2
# direct parts of the force: constant, proportional to deflection and to velocity
DIRECT = 3


def _numbers(values) -> tuple[Array, ...]:
    return tuple(jnp.asarray(value, dtype=float) for value in values)


class ByMotion(Term):
    """A constant force, a stiffness about a given position, and damping."""

    name: ClassVar[str] = "by_motion"
    sentence: ClassVar[str] = "a force that is linear in the motion"
    listed: ClassVar[bool] = False
    parts: tuple[Array, ...] = eqx.field(converter=_numbers)
    middle: Float[Array, ""]

    def acceleration(self, motion: Motion):
        one, stiffness, damping = self.parts
        deflection = motion.position - self.middle
        return one + stiffness * deflection + damping * motion.velocity

    def numbers(self) -> tuple[Array, ...]:
        return self.parts

    def parameters(self, place: int) -> list[Parameter]:
        return [
            Parameter(
                f"{self.name}_{k}",
                lambda m, k=k: terms_of(m)[place].parts[k],  # pyright: ignore
                scale=1.0,
            )
            for k in range(DIRECT)
        ]


class HiddenForce(Term):
    """A force that is a sum of signals, which differ from recording to recording.

    **Arguments:** strengths `shared`, `starts` and `direct`; the index of the `record`;
    a `table` of the signals `(r, n, SHARED + STARTS)` at the times `begin + k interval`
    of each recording; the `middle` of the positions.
    """

    name: ClassVar[str] = "hidden_force"
    sentence: ClassVar[str] = "a force with an internal state"
    listed: ClassVar[bool] = False
    label: ClassVar[str] = "hidden"
    shared: tuple[Array, ...] = eqx.field(converter=_numbers)
    starts: tuple[Array, ...] = eqx.field(converter=_numbers)
    direct: tuple[Array, ...] = eqx.field(converter=_numbers)
    record: Float[Array, ""]
    table: Float[Array, "r n s"]
    begin: Float[Array, " r"]
    interval: Float[Array, " r"]
    middle: Float[Array, ""]

    @classmethod
    def empty(cls, records: int, samples: int) -> "HiddenForce":
        """Return a force without effect, with room for the given numbers of recordings
        and samples.
        """
        return cls(
            [0.0] * SHARED,
            [0.0] * STARTS,
            [0.0] * DIRECT,
            jnp.asarray(0.0),
            jnp.zeros((records, samples, SHARED + STARTS)),
            jnp.zeros(records),
            jnp.ones(records),
            jnp.asarray(0.0),
        )

    def acceleration(self, motion: Motion):
        row = self.record.astype(int)
        place = (motion.t - self.begin[row]) / self.interval[row]
        last = self.table.shape[1] - 4
        first = jnp.clip(jnp.floor(place) - 1, 0, last)
        # interpolate by the cubic through four samples
        u = jnp.clip(place - first, 0.0, 3.0)
        near = jax.lax.dynamic_slice(
            self.table, (row, first.astype(int), 0), (1, 4, SHARED + STARTS)
        )[0]
        a, b, c, d = u, u - 1, u - 2, u - 3
        weights = jnp.stack(
            [-b * c * d / 6, a * c * d / 2, -a * b * d / 2, a * b * c / 6]
        )
        force = (weights @ near) @ jnp.stack([*self.shared, *self.starts])
        return force + ByMotion(self.direct, self.middle).acceleration(motion)

    def numbers(self) -> tuple[Array, ...]:
        return (*self.shared, *self.starts, *self.direct)

    def parameters(self, place: int) -> list[Parameter]:
        def one(kind: str, k: int, per_record: bool) -> Parameter:
            return Parameter(
                f"{self.label}_{kind}_{k}",
                lambda m: getattr(terms_of(m)[place], kind)[k],
                nominal=0.0,
                scale=1.0,
                per_record=per_record,
            )

        records = tuple(float(r) for r in range(self.table.shape[0]))
        return [
            *(one("shared", k, False) for k in range(SHARED)),
            *(one("starts", k, True) for k in range(STARTS)),
            *(one("direct", k, False) for k in range(DIRECT)),
            Parameter(
                f"{self.label}_record",
                lambda m: terms_of(m)[place].record,  # pyright: ignore
                known=records,
            ),
        ]
