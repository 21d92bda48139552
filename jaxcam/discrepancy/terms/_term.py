"""A physical effect that a model may lack, as a term with a strength."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from ...fitting import Model, Parameter
from ._motion_scales import MotionScales
from ._value import Value
from ._where import Where


# The methods through which a term acts, with the part of the model in which each acts
_METHODS = {
    "acceleration": Where.FLIGHT,
    "contact": Where.CONTACT,
    "restitution": Where.IMPACT,
    "sensed": Where.SENSOR,
}


EVERY = -1
"""The `constraint` of a term that acts at all gaps."""


class Motion(NamedTuple):
    """The motion at which a term is evaluated.

    `position` and `velocity` are those of the term's `coordinate`. Without a drive,
    `phase` is the time (s) and `rate` is 1; otherwise, they are the drive angle (rad)
    and the drive speed (rad/s). `state` `(n,)` is zero for a term that acts on a
    surface. `pushed` is the acceleration of the position without any terms.
    """

    t: Any
    """Time (s)."""
    position: Any
    """Position of the term's coordinate."""
    velocity: Any
    """Velocity of the term's coordinate."""
    phase: Any
    """Drive angle (rad), or time without a drive."""
    rate: Any = 1.0
    """Speed of the drive (rad/s), or 1 without a drive."""
    state: Any = None
    """State `(n,)`; zero for a term that acts on a surface."""
    pushed: Any = 0.0
    """Acceleration of the position without any terms."""


MOTION = "[q]"
"""Placeholder in units for the unit of the coordinate on which a term acts."""


# saved systems may omit these fields, which then have their defaults
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
    """Declare a fitted field of a term.

    Args:
        unit: Unit shown in tables; `[q]` is replaced by the unit of the coordinate.
        size: Size of a significant change, for scaling; it does not influence the
            result.
        lower: Lower bound, for example for a sign required by physics.
        upper: Upper bound.
        default: Value of a new term.
        inner: Whether the field has no effect while the strengths are zero, like an
            edge or a frequency. The fit starts from the best of the values that the
            term's method `starts` returns; if it returns none, the parameter must be a
            frequency (Hz), which a scan finds.

    Returns:
        A field.

    Examples:
        >>> from jaxcam.discrepancy import Term, strength
        >>> class Damping(Term):
        ...     name, sentence = "damping", "viscous damping"
        ...     rate: float = strength("1/s", 0.1, lower=0.0)
        ...     def acceleration(self, motion):
        ...         return -self.rate * motion.velocity
        >>> Damping().strengths()[0].unit
        '1/s'
    """
    metadata = {
        "strength": Strength("", unit, size, lower, upper, inner),
    }
    return eqx.field(
        default=default,
        converter=lambda value: jnp.asarray(value, dtype=float),
        metadata=metadata,
    )


def constant(default: float):
    """Declare a constant of a term: it is not fitted, and a saved file may omit it.

    The constant is an array, so that fits with other values need no other program.
    """
    return eqx.field(
        default=default,
        converter=lambda value: jnp.asarray(value, dtype=float),
        metadata=_SPARE,
    )


@dataclasses.dataclass(frozen=True)
class Strength:
    """One fitted parameter of a term, as declared by `strength`."""

    name: str
    """Name of the field."""
    unit: str
    """Unit."""
    size: float
    """Size of a significant change."""
    lower: float = -math.inf
    """Lower bound."""
    upper: float = math.inf
    """Upper bound."""
    inner: bool = False
    """Whether the parameter has no effect while the strengths are zero."""


class Term(eqx.Module):
    """A physical effect that a model may lack. Subclass `Term` and declare strengths
    with `strength`.

    A term with zero strengths has no effect. It acts in flight, on the surface, at
    impacts or on the sensor of the first coordinate if a subclass overrides
    `acceleration`, `contact`, `restitution` or `sensed`, respectively; `acts` follows
    from these methods.

    Raises:
        TypeError: A subclass declares `acts` that differ from the methods it overrides.

    Examples:
        >>> from jaxcam.discrepancy import Term, strength
        >>> class Drag(Term):
        ...     name, sentence = "drag", "drag that grows with the square of the speed"
        ...     factor: float = strength("1/[q]", 0.1)
        ...     def acceleration(self, motion):
        ...         return -self.factor * motion.velocity * abs(motion.velocity)
        >>> [str(place) for place in Drag().acts]
        ['flight']
    """

    name: ClassVar[str] = ""
    """Name of the term."""
    sentence: ClassVar[str] = ""
    """The effect, in words that continue "the model lacks"."""
    where: ClassVar[str] = Where.FLIGHT
    """A [`Where`][jaxcam.discrepancy.terms.Where] or its name; default: the first of
    `acts`."""
    region: ClassVar[str] = "everywhere"
    """Part of the motion, in words."""
    source: ClassVar[str] = ""
    """Literature reference."""
    listed: ClassVar[bool] = True
    """False for a term that only describes an unknown effect and is never a verdict."""
    reference_speed: ClassVar[str] = ""
    """Name of the speed in `References` that scales the form of the term, if any. A
    speed that a rig file does not state is fitted once the term is named."""
    corner: ClassVar[bool] = False
    """Whether the force jumps, as dry friction does, and is therefore smoothed."""
    acts: ClassVar[tuple[str, ...]] = ()
    """Parts of the model in which the term acts."""
    coordinate: int = eqx.field(default=0, static=True, kw_only=True, metadata=_SPARE)
    """Index of the coordinate on which the force acts and whose position and velocity
    the term uses.
    """
    constraint: int = eqx.field(default=0, static=True, kw_only=True, metadata=_SPARE)
    """Index of the gap whose surface or restitution is changed; `EVERY` for the
    restitution at all gaps.
    """
    motion_unit: str = eqx.field(
        default="rad", static=True, kw_only=True, metadata=_SPARE
    )
    """Unit of the coordinate."""

    def __init_subclass__(cls, **options):
        super().__init_subclass__(**options)
        above = cls.__mro__[: cls.__mro__.index(Term)]
        overridden = {name for one in above for name in vars(one)}
        acts = tuple(where for name, where in _METHODS.items() if name in overridden)
        stated = vars(cls).get("acts", acts)
        if set(stated) != set(acts):
            raise TypeError(
                f"{cls.__name__} declares acts = {tuple(map(str, stated))} but "
                f"overrides the methods for {tuple(map(str, acts))}; leave `acts` out."
            )
        cls.acts = acts
        if acts and not any("where" in vars(one) for one in above):
            cls.where = acts[0]

    def acceleration(self, motion: Motion):
        """Return the acceleration added in flight."""
        del motion
        return 0.0

    def contact(self, motion: Motion):
        """Return the added height of the surface, in units of the gap, as a function of
        time and phase.
        """
        del motion
        return 0.0

    def restitution(self, approach, motion: Motion):
        """Return the factor on the coefficient of restitution at an approach speed."""
        del approach, motion
        return 1.0

    def sensed(self, motion: Motion):
        """Return the error of the sensor of the first coordinate, in its unit."""
        del motion
        return 0.0

    def acts_at(self, number: int) -> bool:
        """Return whether the gap with this index is one at which the term acts."""
        return self.constraint in (number, EVERY)

    def scaled(self, scales: MotionScales) -> "Term":
        """Return the term with constants taken from the recordings."""
        del scales
        return self

    def starts(self) -> tuple[Mapping[str, float], ...]:
        """Return values of the inner parameters from which a fit may start.

        There are none for a frequency, which a scan finds.
        """
        return ()

    def prepared(self) -> "Term":
        """Return the term with precomputed quantities that it needs at every step."""
        return self

    def described(self) -> str:
        """Return the part of the motion in which the term acts, in words."""
        return self.region

    def exact(self) -> "Term":
        """Return the term for use outside a fit: its derivatives are exact instead of
        averaged over an integration step.
        """
        return self

    def strengths(self) -> tuple[Strength, ...]:
        """Return the fitted parameters, in the order of the fields."""
        found = []
        for field in dataclasses.fields(self):
            one = field.metadata.get("strength")
            if one is not None:
                unit = self.written(one.unit)
                found.append(dataclasses.replace(one, name=field.name, unit=unit))
        return tuple(found)

    def numbers(self) -> tuple[Any, ...]:
        """Return the values of the strengths, in the order of the fields."""
        return tuple(getattr(self, one.name) for one in self.strengths())

    def written(self, unit: str) -> str:
        """Return a unit with the unit of the coordinate inserted."""
        return unit.replace(MOTION, self.motion_unit)

    def reported(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Return the reported values, by name; by default the strengths."""
        return dict(values)

    def parameters(self, place: int) -> list[Parameter]:
        """Return the parameters of a fit, for the term at a given index in a
        `WithTerms`.
        """
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
    """An error of the motion sensor; it acts on a field of that sensor."""

    where: ClassVar[str] = Where.SENSOR
    """The sensor."""
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
    """Return the terms of a model whose system is a `WithTerms`."""
    return model.system.terms  # pyright: ignore


def watching(model: Model) -> str:
    """Return the first channel that measures the first coordinate, or the first
    channel.
    """
    place, _ = model.system.coordinates[0]  # pyright: ignore
    shown = [name for name, one in model.sensors.items() if one.observe == place]
    return next(iter(shown or model.sensors))


def _first(model: Model):
    return model.sensors[watching(model)]
