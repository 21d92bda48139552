"""The library of effects that models of machines often omit."""

import math
from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp

from ...recordings import References
from ._bivariate import Axis, BivariateForce
from ._by_place import StribeckCurve, UnevenFriction
from ._free_function import FREE
from ._hidden_elements import Hysteresis, Relaxation, Resonator
from ._one_way import (
    DampingBackwards,
    DampingForwards,
    FrictionBackwards,
    FrictionForwards,
)
from ._restitution import RestitutionPower, RestitutionVelocity
from ._sensor_terms import SensorGain, SensorLag, SensorOffset
from ._springs import (
    BilinearSpring,
    ConstantForce,
    LinearSpring,
    StopAbove,
    StopBelow,
)
from ._switched_base import SwitchedWithHidden, SwitchedWithTerms
from ._term import constant, Motion, strength, Term
from ._value import Value
from ._where import Where
from ._with_hidden import WithHidden
from ._with_terms import WithTerms


# In units of the dry friction: the largest applied force that is balanced exactly, the
# range beyond 1 over which the balance fades, and the force assumed without friction
_HELD, _FADE, _MANY = 0.99, 0.5, 1e3


class ViscousDamping(Term):
    """Damping proportional to the velocity, `-c1 v`."""

    name: ClassVar[str] = "viscous_damping"
    sentence: ClassVar[str] = "viscous damping, a force opposing the motion"
    region: ClassVar[str] = "in flight, in proportion to the speed"
    source: ClassVar[str] = "Rayleigh, The Theory of Sound, 1877, section 45"
    c1: float = strength("1/s", 0.1, lower=0.0)

    def acceleration(self, motion: Motion):
        return -self.c1 * motion.velocity


class CoulombFriction(Term):
    """Dry friction, `-fc sign(v)`, which holds a body at rest under a force below `fc`.

    The sign is smoothed to `tanh(v / slip)` for the integration; `slip` (rad/s) is far
    below the usual speeds of the motion. While friction holds the body, the
    `tanh` is shifted so that it balances the applied force at rest, and the body does
    not creep.
    """

    name: ClassVar[str] = "coulomb_friction"
    sentence: ClassVar[str] = "Coulomb friction, a constant force opposing the motion"
    region: ClassVar[str] = "in flight, changing sign with the velocity"
    source: ClassVar[str] = (
        "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 1994"
    )
    corner: ClassVar[bool] = True
    fc: float = strength("[q]/s^2", 0.1, lower=0.0)
    slip: float = constant(References.slip_speed)

    def acceleration(self, motion: Motion):
        share = _share_of(motion.pushed, self.fc)
        size = jnp.abs(share)
        # beyond the friction, the balance fades, so that a body reverses smoothly
        held = jnp.where(size < 1, size, jnp.clip((1 + _FADE - size) / _FADE, 0.0, 1.0))
        balance = jnp.sign(share) * jnp.arctanh(jnp.minimum(held, _HELD))
        return -self.fc * jnp.tanh(motion.velocity / self.slip + balance)


def _share_of(push, friction):
    """Return the applied force in units of the friction, or a large number if there is
    no friction.
    """
    some = friction > 0
    return jnp.where(some, push / jnp.where(some, friction, 1.0), _MANY)


class QuadraticDrag(Term):
    """Turbulent drag, `-c2 |v| v`."""

    name: ClassVar[str] = "quadratic_drag"
    sentence: ClassVar[str] = "quadratic drag, as from air or oil"
    region: ClassVar[str] = "in flight, at large speeds"
    source: ClassVar[str] = "Batchelor, An Introduction to Fluid Dynamics, 5.11"
    c2: float = strength("1/[q]", 0.1, lower=0.0)

    def acceleration(self, motion: Motion):
        return -self.c2 * jnp.abs(motion.velocity) * motion.velocity


class NonlinearSpring(Term):
    """A spring that hardens (or softens) away from its centre, `-k3 (q - q0)^3`."""

    name: ClassVar[str] = "nonlinear_spring"
    sentence: ClassVar[str] = "a cubic component of the spring force"
    region: ClassVar[str] = "in flight, at large deflections"
    source: ClassVar[str] = "Duffing 1918; Kovacic and Brennan 2011, chapter 2"
    k3: float = strength("1/(s^2 [q]^2)", 100.0)
    center: float = constant(References.spring_center)

    def acceleration(self, motion: Motion):
        return -self.k3 * (motion.position - self.center) ** 3


class CamProfileError(Term):
    """A cam that is out of round by `run cos(2 phi + lead)`; phi is the drive angle."""

    name: ClassVar[str] = "cam_profile_error"
    sentence: ClassVar[str] = "a profile error, twice per period of the drive"
    where: ClassVar[str] = Where.CONTACT
    region: ClassVar[str] = "at impacts and in contact, as a function of drive angle"
    source: ClassVar[str] = "Norton, Cam Design and Manufacturing Handbook, chapter 12"
    run: float = strength("[q]", 1e-4)
    lead: float = constant(References.profile_lead)

    def contact(self, motion: Motion):
        return self.run * jnp.cos(2 * motion.phase + self.lead)


class ExternalVibration(Term):
    """A vibration of the foundation, `ext sin(2 pi fe t + phase)`.

    The fitted parameters are the amplitudes of sine and cosine, in which the term is
    linear.
    """

    name: ClassVar[str] = "external_vibration"
    sentence: ClassVar[str] = "an external vibration at its own frequency"
    region: ClassVar[str] = "in flight, periodic in time"
    source: ClassVar[str] = "Den Hartog, Mechanical Vibrations, 1956, section 2.9"
    ext_sin: float = strength("[q]/s^2", 0.1)
    ext_cos: float = strength("[q]/s^2", 0.1)
    fe: float = strength("Hz", 0.05, lower=0.0, default=10.0, inner=True)

    def acceleration(self, motion: Motion):
        angle = 2 * jnp.pi * self.fe * motion.t
        return self.ext_sin * jnp.sin(angle) + self.ext_cos * jnp.cos(angle)

    def reported(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Amplitude, frequency and phase."""
        a, b, fe = (values[name] for name in ("ext_sin", "ext_cos", "fe"))
        size = math.hypot(a.value, b.value)
        error = math.hypot(a.value * a.stderr, b.value * b.stderr) / size
        phase = math.hypot(a.value * b.stderr, b.value * a.stderr) / size**2
        return {
            "ext": Value(size, error, self.written("[q]/s^2")),
            "fe": fe,
            "phase": Value(math.atan2(b.value, a.value), phase, "rad"),
        }


class DriveRipple(Term):
    """A drive whose speed varies with its angle phi, `w (1 + eps cos(phi - psi))`.

    The ripple is identified in the channel of the drive angle. The motion is computed
    from that channel, with or without this term.
    """

    name: ClassVar[str] = "drive_ripple"
    sentence: ClassVar[str] = "a ripple of the drive speed, once per revolution"
    where: ClassVar[str] = Where.DRIVE
    region: ClassVar[str] = "in the drive angle itself"
    source: ClassVar[str] = "Norton, Cam Design and Manufacturing Handbook, chapter 10"


class StribeckFriction(Term):
    """Dry friction that is larger near standstill, `-fs exp(-(v / vs)^2) sign(v)`."""

    name: ClassVar[str] = "stribeck_friction"
    sentence: ClassVar[str] = "friction that is larger at low speed"
    region: ClassVar[str] = "in flight, near standstill"
    source: ClassVar[str] = (
        "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 1994"
    )
    listed: ClassVar[bool] = False
    corner: ClassVar[bool] = True
    fs: float = strength("[q]/s^2", 0.1, lower=0.0)
    speed: float = constant(References.stribeck_speed)
    slip: float = constant(References.slip_speed)

    def acceleration(self, motion: Motion):
        slow = jnp.exp(-((motion.velocity / self.speed) ** 2))
        return -self.fs * slow * jnp.tanh(motion.velocity / self.slip)


class AsymmetricFriction(Term):
    """Dry friction that acts in one direction of motion only."""

    name: ClassVar[str] = "asymmetric_friction"
    sentence: ClassVar[str] = "friction that acts in one direction of motion only"
    region: ClassVar[str] = "in flight, at positive velocities"
    source: ClassVar[str] = "Armstrong-Helouvry 1991, Control of Machines with Friction"
    listed: ClassVar[bool] = False
    corner: ClassVar[bool] = True
    fa: float = strength("[q]/s^2", 0.1, lower=0.0)
    slip: float = constant(References.slip_speed)

    def acceleration(self, motion: Motion):
        return -self.fa * (1 + jnp.tanh(motion.velocity / self.slip)) / 2


class GravityImbalance(Term):
    """The weight of an arm whose centre of mass is off its hinge, `-g cos(q)`."""

    name: ClassVar[str] = "gravity_imbalance"
    sentence: ClassVar[str] = "the weight of an unbalanced arm"
    region: ClassVar[str] = "in flight, as a function of position"
    source: ClassVar[str] = "Meriam and Kraige, Dynamics, chapter 6"
    listed: ClassVar[bool] = False
    imbalance: float = strength("[q]/s^2", 0.1)

    def acceleration(self, motion: Motion):
        return -self.imbalance * jnp.cos(motion.position)


class SpeedDependentBounce(Term):
    """A coefficient of restitution that changes by `br` per rad/s of drive speed."""

    name: ClassVar[str] = "restitution_drive_speed"
    sentence: ClassVar[str] = (
        "a coefficient of restitution that depends on the drive speed"
    )
    where: ClassVar[str] = Where.IMPACT
    region: ClassVar[str] = "at impacts, as a function of drive speed"
    source: ClassVar[str] = "Alzate, PhD thesis, Naples, 2008, section 4.6.1"
    listed: ClassVar[bool] = False
    br: float = strength("s/rad", 1e-3)

    def restitution(self, approach, motion: Motion):
        del approach
        return 1 + self.br * motion.rate


_EXTENDED = (
    StopAbove,
    StopBelow,
    BilinearSpring,
    LinearSpring,
    ConstantForce,
    DampingForwards,
    DampingBackwards,
    FrictionForwards,
    FrictionBackwards,
    StribeckCurve,
    UnevenFriction,
    RestitutionPower,
)


def library(
    turned: bool = True,
    references: References = References(),
    clocked: bool | None = None,
    extended: bool = False,
    profiled: bool | None = None,
) -> tuple[Term, ...]:
    """Return all terms that `diagnose` tries by default.

    Args:
        turned: Whether the system has a drive or a periodic forcing.
        references: Constants of a rig that occur in the terms (`rig.references`),
            such as the centre of a nonlinear spring or the reference speed of a
            restitution law.
        clocked: Whether a drive or a measured input fixes the time origin (default:
            the value of `turned`). If nothing fixes it, a sensor lag is the same as a
            shift of the time origin, and the term for a lag is omitted.
        extended: Whether to add terms that most rigs already have as parameters, or
            that take longer to search for: position-dependent forces with an edge,
            friction that depends on direction, speed or position, and a power law of
            restitution. The constants of these terms come from the recordings.
        profiled: Whether the drive moves a surface, whose profile may have errors
            (default: the value of `turned`).

    Returns:
        A tuple of [`jaxcam.discrepancy.Term`][].

    Examples:
        >>> from jaxcam.discrepancy import library
        >>> len(library()) > len(library(turned=False))
        True
    """
    slip = references.slip_speed
    found: list[Term] = [
        ViscousDamping(),
        CoulombFriction(slip=slip),
        QuadraticDrag(),
        NonlinearSpring(center=references.spring_center),
        RestitutionVelocity(reference=references.impact_speed),
        ExternalVibration(),
        SensorLag(),
        StribeckFriction(speed=references.stribeck_speed, slip=slip),
        AsymmetricFriction(slip=slip),
        GravityImbalance(),
        SensorGain(),
        SensorOffset(),
    ]
    if not (turned if clocked is None else clocked):
        found = [term for term in found if not isinstance(term, SensorLag)]
    if turned if profiled is None else profiled:
        found.append(CamProfileError(lead=references.profile_lead))
    if turned:
        found.append(SpeedDependentBounce())
    if extended:
        found += [kind() for kind in _EXTENDED]
    return tuple(found)


def saved_classes() -> tuple[type, ...]:
    """Return the term classes that `load_system` needs to load a saved system.

    Returns:
        A tuple of classes.

    Examples:
        >>> from jaxcam.discrepancy.terms import saved_classes, system_with_terms
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.models.saved import system_from_json, system_to_json
        >>> plain = system_to_json(system_with_terms(BouncingBall(), ()))
        >>> type(system_from_json(plain, classes=saved_classes())).__name__
        'WithTerms'
    """
    terms = (type(term) for term in library(extended=True))
    elements = (WithHidden, SwitchedWithHidden, Resonator, Relaxation, Hysteresis)
    return (
        WithTerms,
        SwitchedWithTerms,
        DriveRipple,
        *terms,
        *FREE.values(),
        Axis,
        BivariateForce,
        *elements,
    )
