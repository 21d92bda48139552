"""The common part of all functions whose coefficients are fitted."""

from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from ...fitting import Parameter
from ._term import Term, terms_of


class FittedFunction(Term):
    """A function in a slot of a problem, with the `label` of its parameters and their
    values, the `coefficients`.
    """

    sentence: ClassVar[str] = "an unnamed function"
    listed: ClassVar[bool] = False
    label: eqx.AbstractVar[str]
    coefficients: eqx.AbstractVar[tuple[Array, ...]]

    def numbers(self) -> tuple[Array, ...]:
        return self.coefficients

    def parameters(self, place: int) -> list[Parameter]:
        return [
            Parameter(
                f"{self.label}_{k}",
                lambda m, k=k: terms_of(m)[place].coefficients[k],  # pyright: ignore
                nominal=0.0,
                scale=1.0,
            )
            for k in range(len(self.coefficients))
        ]
