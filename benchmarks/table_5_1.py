"""Rank forms of a missing force or restitution law by the speeds of Table 5.1.

The thesis compares the speeds at which the type of motion changes in the experiment and
in the simulation (Table 5.1). With only four speeds, a free function of many
coefficients would explain anything; here, each form has one strength, which is fitted
together with the coefficient of restitution. The forms cover what a free force of the
position or a free restitution law may look like: powers and hinges at several places.

    python -m benchmarks.table_5_1 [--forms NAME ...]
"""

import argparse
import time
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from jaxcam.discrepancy import event_causes, library
from jaxcam.discrepancy.terms import strength, Term
from jaxcam.models import preset


RPM = np.pi / 30
# detachment, fold and flip of P(1,1), interruption of chatter
OBSERVED = RPM * np.array([125.0, 150.0, 188.0, 155.0])
ERRORS = RPM * np.array([1.0, 1.0, 2.0, 1.5])
CENTRE, EXTENT = 0.25, 0.1
REFERENCE_SPEED = 1.0


class Power(Term):
    """A restoring force that grows with a power of the deflection (rad)."""

    size: float = strength("rad/s^2", 1.0)
    power: ClassVar[int] = 3

    def acceleration(self, motion):
        u = (motion.position - CENTRE) / EXTENT
        return -self.size * jnp.sign(u) ** (self.power + 1) * u**self.power


class Quadratic(Power):
    name: ClassVar[str] = "force, quadratic"
    power: ClassVar[int] = 2


class Cubic(Power):
    name: ClassVar[str] = "force, cubic"


class Quintic(Power):
    name: ClassVar[str] = "force, fifth power"
    power: ClassVar[int] = 5


class Hinge(Term):
    """A restoring force that acts only above a position."""

    stiffness: float = strength("1/s^2", 20.0)
    edge: ClassVar[float] = 0.3

    def acceleration(self, motion):
        return -self.stiffness * jnp.maximum(motion.position - self.edge, 0.0)


class LowHinge(Hinge):
    name: ClassVar[str] = "force, above 0.30 rad"


class MiddleHinge(Hinge):
    name: ClassVar[str] = "force, above 0.36 rad"
    edge: ClassVar[float] = 0.36


class HighHinge(Hinge):
    name: ClassVar[str] = "force, above 0.42 rad"
    edge: ClassVar[float] = 0.42


class RestitutionPower(Term):
    """A coefficient of restitution that is a power of the approach speed."""

    name: ClassVar[str] = "restitution, power of the speed"
    exponent: float = strength("-", 0.1)

    def restitution(self, approach, motion):
        del motion
        share = jnp.maximum(approach / REFERENCE_SPEED, 1e-3)
        return jnp.exp(-self.exponent * jnp.log(share))


class RestitutionFast(Term):
    """A coefficient of restitution that changes linearly above a speed."""

    name: ClassVar[str] = "restitution, linear above 1 rad/s"
    slope: float = strength("s/rad", 0.1)

    def restitution(self, approach, motion):
        del motion
        above = jnp.maximum(approach - REFERENCE_SPEED, 0.0)
        return jnp.maximum(1.0 - self.slope * above, 0.0)


FORMS = (
    Cubic,
    Quadratic,
    Quintic,
    LowHinge,
    MiddleHinge,
    HighHinge,
    RestitutionPower,
    RestitutionFast,
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = [one.name for one in FORMS]
    parser.add_argument("--forms", nargs="*", choices=names, default=names)
    args = parser.parse_args()
    terms = [one() for one in FORMS if one.name in args.forms]
    terms += [one for one in library() if one.name == "viscous_damping"]
    begun = time.process_time()
    found = event_causes(
        preset("calibrated"),
        OBSERVED,
        ERRORS,
        terms,
        lambda rig: rig.restitution.intercept,
        0.15,
        progress=lambda share: print(f"{share:.0%}", flush=True),
    )
    print(f"{'form':34} strength   detachment fold flip interruption (rpm)  misfit")
    for one in found:
        speeds = " ".join(f"{value:6.1f}" for value in one.speeds / RPM)
        print(f"{one.name:34} {one.strength:9.3g} {speeds} {one.misfit:8.3g}")
    print(f"CPU time {time.process_time() - begun:.0f} s")


if __name__ == "__main__":
    main()
