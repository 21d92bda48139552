"""A piece of physics that a model may lack, as a term with a strength."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from ...fitting import Model, Parameter
from ._value import Value
from ._visited import Visited
from ._where import Where


# The methods by which a term acts, and where
_METHODS = {
    "acceleration": Where.FLIGHT,
    "contact": Where.CONTACT,
    "restitution": Where.IMPACT,
    "sensed": Where.SENSOR,
}


class Motion(NamedTuple):
    """The motion as a term sees it: time (s), position, velocity, drive and whole
    state.

    `position` and `velocity` are those of the term's `coordinate`. `phase` is the angle
    that the drive has turned (rad), or time itself without a drive; `rate` the drive's
    speed (rad/s), or one. `state` `(n,)` is zero where a term acts on a surface.
    `pushed` is the acceleration of the position without any terms.
    """

    t: Any
    position: Any
    velocity: Any
    phase: Any
    rate: Any = 1.0
    state: Any = None
    pushed: Any = 0.0


MOTION = "[q]"
"""Stands in units for that of the coordinate that a term acts on."""


# where a term acts is left out of files that do not say it
_SPARE = {"spare": True}


def strength(
    unit: str,
    size: float,
    *,
    lower: float = -math.inf,
    upper: float = math.inf,
    default: float = 0.0,
    inner: bool = False,
):
    """A field of a term that is fitted.

    Args:
        unit: For tables; `[q]` in it stands for the unit of the coordinate.
        size: A change that matters; it does not influence the result.
        lower: Signs that physics demands.
        upper: Signs that physics demands.
        inner: A number without effect while the strengths are zero, such as an edge. It
            is fitted from the best of the term's `starts`, or, without any, is a
            frequency (Hz) that a scan finds.
    """
    metadata = {
        "strength": Strength("", unit, size, lower, upper, inner),
    }
    return eqx.field(
        default=default,
        converter=lambda value: jnp.asarray(value, dtype=float),
        metadata=metadata,
    )


@dataclasses.dataclass(frozen=True)
class Strength:
    """One number of a term that is fitted, as `strength` declares it."""

    name: str
    unit: str
    size: float
    lower: float = -math.inf
    upper: float = math.inf
    inner: bool = False


class Term(eqx.Module):
    """Something a model may lack. Subclass it, and declare its numbers by `strength`.

    With all strengths zero a term changes nothing. It acts in flight, on the surface,
    in impacts or on the sensor of the first coordinate where a subclass overrides
    `acceleration`, `contact`, `restitution` or `sensed`; `acts` follows from these
    methods.

    Class variables: `name`, `sentence` (what it is, in words that go on after "the
    model lacks"), `where` (a [`Where`][jaxcam.discrepancy.terms.Where] or its name; by
    default the first of `acts`), `region` (of the motion, in words), `source`
    (literature), `listed` (false for one that describes a shape but is not a verdict by
    itself), `corner` (whether its force jumps, as dry friction does, and is smoothed).

    Fields, given by name: `coordinate`, the number of the coordinate (0 for the first)
    that is pushed and whose position and velocity are seen; `constraint`, that of the
    gap whose surface or restitution is another; `motion_unit`, that of the coordinate.

    Raises:
        TypeError: For a subclass whose own `acts` is not what it overrides.
    """

    name: ClassVar[str] = ""
    sentence: ClassVar[str] = ""
    where: ClassVar[str] = Where.FLIGHT
    region: ClassVar[str] = "everywhere"
    source: ClassVar[str] = ""
    listed: ClassVar[bool] = True
    corner: ClassVar[bool] = False
    acts: ClassVar[tuple[str, ...]] = ()
    coordinate: int = eqx.field(default=0, static=True, kw_only=True, metadata=_SPARE)
    constraint: int = eqx.field(default=0, static=True, kw_only=True, metadata=_SPARE)
    motion_unit: str = eqx.field(
        default="rad", static=True, kw_only=True, metadata=_SPARE
    )

    def __init_subclass__(cls, **options):
        super().__init_subclass__(**options)
        above = cls.__mro__[: cls.__mro__.index(Term)]
        overridden = {name for one in above for name in vars(one)}
        acts = tuple(where for name, where in _METHODS.items() if name in overridden)
        stated = vars(cls).get("acts", acts)
        if set(stated) != set(acts):
            raise TypeError(
                f"{cls.__name__} states acts = {tuple(map(str, stated))} and overrides "
                f"the methods for {tuple(map(str, acts))}; leave `acts` out."
            )
        cls.acts = acts
        if acts and not any("where" in vars(one) for one in above):
            cls.where = acts[0]

    def acceleration(self, motion: Motion):
        """Return the acceleration added in flight."""
        del motion
        return 0.0

    def contact(self, motion: Motion):
        """Return the added height of the surface, in units of the gap; of time and
        phase.
        """
        del motion
        return 0.0

    def restitution(self, approach, motion: Motion):
        """Factor on the restitution coefficient at an approach speed."""
        del approach, motion
        return 1.0

    def sensed(self, motion: Motion):
        """What the sensor of the first coordinate shows besides, in its unit."""
        del motion
        return 0.0

    def scaled(self, visited: Visited) -> "Term":
        """The term with the constants of its form as recordings suggest them."""
        del visited
        return self

    def starts(self) -> tuple[Mapping[str, float], ...]:
        """Values of its inner numbers from which a fit may start.

        Of a frequency there are none here; a scan finds it.
        """
        return ()

    def prepared(self) -> "Term":
        """The term with whatever it needs at every step worked out once."""
        return self

    def strengths(self) -> tuple[Strength, ...]:
        """The numbers that are fitted, in the order of the fields."""
        found = []
        for field in dataclasses.fields(self):
            one = field.metadata.get("strength")
            if one is not None:
                unit = self.written(one.unit)
                found.append(dataclasses.replace(one, name=field.name, unit=unit))
        return tuple(found)

    def numbers(self) -> tuple[Any, ...]:
        """Values of the strengths, in the same order."""
        return tuple(getattr(self, one.name) for one in self.strengths())

    def written(self, unit: str) -> str:
        """A unit with that of the coordinate in it."""
        return unit.replace(MOTION, self.motion_unit)

    def reported(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Return the reported strengths, by name; here the strengths."""
        return dict(values)

    def parameters(self, place: int) -> list[Parameter]:
        """Parameters of a fit, of the term at some place of a `WithTerms`."""
        return [
            Parameter(
                one.name,
                lambda m, name=one.name: getattr(terms_of(m)[place], name),
                scale=one.size,
                lower=one.lower,
                upper=one.upper,
                unit=one.unit,
            )
            for one in self.strengths()
        ]


class SensorTerm(Term):
    """A fault of the sensor of the motion: it acts on a field of that sensor."""

    where: ClassVar[str] = Where.SENSOR
    fields: ClassVar[tuple[str, ...]] = ()
    """Fields of `jaxcam.fitting.Sensor`, one for each strength."""

    def parameters(self, place: int) -> list[Parameter]:
        del place
        return [
            Parameter(
                one.name,
                lambda m, field=field: getattr(_first(m), field),
                scale=one.size,
                lower=one.lower,
                upper=one.upper,
                unit=one.unit,
            )
            for one, field in zip(self.strengths(), self.fields, strict=True)
        ]


def terms_of(model: Model) -> tuple[Term, ...]:
    """The terms of a model whose system is a `WithTerms`."""
    return model.system.terms  # pyright: ignore


def _first(model: Model):
    return next(iter(model.sensors.values()))
