"""Parametric forms: functions of an argument with a few parameters, and their sums."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple


MOST_PARTS = 3
"""Largest number of forms in a sum."""


class Place(NamedTuple):
    """The argument at which a form is evaluated.

    `x`: the argument, an array; `u`: its position in the range, from 0 to 1; `v`: the
    argument divided by the range.
    """

    x: Any
    u: Any
    v: Any

    @classmethod
    def between(cls, argument, low, high):
        """Return the place of an argument relative to a range."""
        width = high - low
        return cls(argument, (argument - low) / width, argument / width)

    @property
    def xp(self):
        """Return the module of the argument: `numpy` or `jax.numpy`."""
        return self.x.__array_namespace__()


class Primitive(NamedTuple):
    """A form: its `name`, `function(place, numbers)` and properties of its parameters.

    - `starts`: for each parameter but the first, values from which a fit may start.
    - `scales`: for each parameter but the first, a significant change.
    - `jump`: half the jump of the form at a change of sign of the velocity, in units of
      its size.
    - `odd`: whether the form is multiplied by the direction of motion.
    - `places`: the parameters that are positions, as fractions of the range; if there
      are two, the first is the lower one.
    - `limits`: for each parameter that is a length or an exponent, its index and the
        value that it must exceed.
    - `ends`: further positions within the range, as a function of the parameters.
    - `apart`: for a form whose value or slope jumps at edges, the distance between them
        as a fraction of the range, as a function of the parameters.
    - `sharp`: whether its value jumps there.
    - `special`: simpler forms that may replace this one after its fit.
    - `parts`: the forms that are added; empty unless the form is a sum.
    """

    name: str
    function: Callable
    starts: tuple[tuple[float, ...], ...] = ()
    scales: tuple[float, ...] = ()
    jump: float = 0.0
    odd: bool = False
    places: tuple[int, ...] = ()
    limits: tuple[tuple[int, float], ...] = ()
    ends: Callable | None = None
    apart: Callable | None = None
    special: "tuple[Special, ...]" = ()
    sharp: bool = False
    parts: tuple[Any, ...] = ()

    def divided(self, numbers) -> "list[tuple[Primitive, Any]]":
        """Return the parts of a sum with their own parameters, or the form itself with
        all of them.
        """
        divided, first = [], 0
        for part in self.parts or (self,):
            divided.append((part, numbers[first : first + part.count]))
            first += part.count
        return divided

    def within(self, numbers) -> bool:
        """Return whether the positions lie in the range of the argument, in ascending
        order, and lengths and exponents exceed their limits.
        """
        if self.parts:
            return all(part.within(own) for part, own in self.divided(numbers))
        numbers = [float(number) for number in numbers]
        places = [numbers[k] for k in self.places]
        every = [*places, *(self.ends(numbers) if self.ends else ())]
        return (
            all(0.0 <= place <= 1.0 for place in every)
            and places == sorted(places)
            and all(numbers[k] > limit for k, limit in self.limits)
        )

    @property
    def count(self) -> int:
        if self.parts:
            return sum(part.count for part in self.parts)
        return 1 + len(self.starts)

    def value(self, place: Place, numbers, direction):
        """Return the complete form, including the jump if the motion has a
        direction.
        """
        if self.parts:
            divided = self.divided(numbers)
            return sum(part.value(place, own, direction) for part, own in divided)
        smooth = self.function(place, numbers)
        turned = smooth * direction if self.odd else smooth
        return turned + self.jump * numbers[0] * direction


class Special(NamedTuple):
    """A simpler `form`, with fewer parameters, that a form may be close to.

    - `numbers(numbers)`: parameters from which its fit may start, given those of the
      other form.
    - `applies(numbers)`: whether that form, with these parameters, may be close to it.
    """

    form: Primitive
    numbers: Callable[[Sequence[float]], Sequence[float]]
    applies: Callable[[Sequence[float]], bool] = lambda numbers: True


def sum_of(parts: Sequence[Primitive], sizes: Sequence[float]) -> Primitive:
    """Return the sum of forms, whose parameters are those of its parts in their order.

    **Arguments:** at most `MOST_PARTS` forms, and their approximate sizes.
    """
    scales: list[float] = []
    for part, size in zip(parts, sizes, strict=True):
        scales += [abs(size), *part.scales]

    return Primitive(
        " + ".join(part.name for part in parts),
        parts[0].function,
        scales=tuple(scales[1:]),
        odd=parts[0].odd,
        sharp=any(part.sharp for part in parts),
        parts=tuple(parts),
    )
