"""Compute the one-dimensional map over a period of a chattering orbit, from local
theory.

At the interruption, the map over a period consists of Theta, a smooth map from a
section after release to an impact D* of the chatter sequence (at time tau* relative to
release), followed by beta. After beta, all motions lie along one direction B, so one
number determines them: epsilon = tau*^2 beta, which corresponds to the relative
velocity c epsilon at release. With A the derivative of Theta, C that of lambda, and mu
the distance of the parameter from the interruption,

    epsilon' = tau*^2 beta(lambda_bar + C A B epsilon + lambda_mu mu),

where the deviation is first mapped to an earlier impact at which it is small, because
it grows linearly only in the coordinate K of [`variational.koenigs`][]. The thesis
(eqs. 6.104 and 6.116) omits tau*^2; its K_beta appears to represent it.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam import HybridSystem
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import normal_directions
from jaxcam.parameters import as_arrays, pick, Where

from ._beta_map import beta_parts
from ._chatter_frame import ChatterFrame, prepared_frame
from ._free_flight import fly
from ._impact_map import ImpactPoint, surface_state
from ._interruption import line
from ._scalar import check_chatter_system
from ._scaling_law import scaling_law
from ._section_turn import (
    impact_after,
    section_to_impact,
    SectionArrival,
    to_section,
)


# deviation of lambda up to which K and lambda - lambda_bar are equal to within rounding
_LINEAR = 1e-8


class ComposedMap(eqx.Module):
    """Local theory of one period around the interruption of complete chatter.

    D* is an impact of the chatter sequence, lambda its dimensionless rebound speed, and
    epsilon the velocity relative to the surface at release divided by the rate of the
    relative acceleration.
    """

    frame: ChatterFrame
    """Release point between the sections at the start and the end of the period, and
    the scales of chatter close to it.
    """
    section: Float[Array, ""]
    """Time of the section at the end of the period (s)."""
    state: Float[Array, "2"]
    """State at the section of the orbit that starts from contact at release, shape
    `(2,)`.
    """
    relative: Float[Array, "2"]
    """Gap and normal velocity of `state`, shape `(2,)`."""
    time: Float[Array, ""]
    """Time of the impact D* on the orbit that starts from contact at release (s)."""
    speed: Float[Array, ""]
    """Rebound speed of D*."""
    lam: Float[Array, ""]
    """Lambda of D*."""
    lambda_bar: Float[Array, ""]
    """Fixed point of the map from the lambda of an impact to that of the next."""
    matrix: Float[Array, "2 2"]
    """A: derivatives of rebound speed and time of D* with respect to the state at the
    section, shape `(2, 2)` (thesis, eq. 6.107).
    """
    vector: Float[Array, "2"]
    """B: derivative of the state at the section with respect to epsilon, shape `(2,)`
    (thesis, eq. 6.103).
    """
    relative_vector: Float[Array, "2"]
    """Derivatives of gap and velocity at the section with respect to epsilon, shape
    `(2,)` (thesis, eq. 6.103).
    """
    covector: Float[Array, "2"]
    """C: derivatives of lambda with respect to rebound speed and time of D*, shape
    `(2,)` (thesis, eq. 6.100).
    """
    by_parameter: Float[Array, ""]
    """Derivative of lambda with respect to the parameter (thesis, eq. 6.114)."""
    incidence: Float[Array, ""]
    """Derivative of lambda - lambda_bar with respect to the parameter, with D* moving
    with the orbit.
    """
    drift: Float[Array, "2"]
    """Derivatives of gap and velocity at the section with respect to the parameter, at
    epsilon = 0, shape `(2,)` (thesis, eq. 6.115).
    """

    @property
    def tau(self) -> Float[Array, ""]:
        """Time of D* relative to release, < 0."""
        return self.time - self.frame.release

    @property
    def feedback(self) -> Float[Array, ""]:
        """C A B: derivative of the next lambda with respect to epsilon."""
        return self.covector @ self.matrix @ self.vector

    def __call__(self, epsilon, parameter=0.0) -> Float[Array, "..."]:
        """Return epsilon of the next period (thesis, eqs. 6.109 and 6.116).

        **Arguments:** `epsilon`, in the unit of time squared; `parameter`, the distance
        of the parameter from the interruption. The two are broadcast together.
        """
        return self._left(self.feedback * epsilon + self.incidence * parameter)

    def at_section(self, speed=0.0, time=0.0) -> Float[Array, "... 2"]:
        """Return gap and velocity at the section after a change of D* (thesis, eq.
        6.104).

        Args:
            speed: Change of the rebound speed of D*.
            time: Change of the time of D* (s).

        Returns:
            Gap and velocity, shape `(..., 2)`.
        """
        moved = self.covector[0] * speed + self.covector[1] * time
        parts = beta_parts(self.lambda_bar + moved, self.frame.restitution)
        return self._section(self.tau**2 * parts.beta, 0.0)

    def along_parameter(self, parameter) -> Float[Array, "... 2"]:
        """Return gap and velocity, at the section, of the orbit from release.

        Args:
            parameter: Distance of the parameter from the interruption, any shape.

        Returns:
            Gap and velocity, shape `(..., 2)` (thesis, eqs. 6.114 and 6.115).
        """
        return self._section(self._left(self.incidence * parameter), parameter)

    def _left(self, deviation):
        """Return epsilon for the deviation of lambda at D* that linear theory predicts.

        The growth from impact to impact is linear only in the coordinate K, so beta is
        evaluated n impacts earlier, where the deviation is small, K is lambda -
        lambda_bar, and tau is larger by p^-n.
        """
        law = scaling_law(self.frame.restitution)
        deviation = jnp.asarray(deviation, jnp.float64)
        size = jnp.where(deviation > 0, deviation, _LINEAR)
        n = jnp.maximum(jnp.ceil(jnp.log(_LINEAR / size) / jnp.log(law.q)), 0.0)
        earlier = law.lambda_bar + law.q**n * deviation
        beta = beta_parts(earlier, self.frame.restitution).beta
        return self.tau**2 * law.p ** (-2 * n) * beta

    def _section(self, epsilon, parameter):
        columns = [
            self.relative[k] + epsilon * self.relative_vector[k] + parameter * drift
            for k, drift in enumerate(self.drift)
        ]
        return jnp.stack(columns, axis=-1)


def composed_map(
    system: HybridSystem, where: Where, rank: int, phase=0.0
) -> ComposedMap:
    """Compose the beta-map with the map over the rest of the period; all derivatives
    come from automatic differentiation.

    Args:
        system: The system at the interruption ([`variational.chatter_interruption`][]).
        where: Selects the parameter.
        rank: Number of the impact D* after release, counted from 0. The later D* is,
            the better the lambda-map describes the following impacts, but the smaller
            the deviations for which the linear maps A and C (fields `matrix` and
            `covector` of the result) are valid: a deviation must change the time of D*
            by much less than the time from D* to release.
        phase: Phase of the section, in periods; the section must lie in the flight
            after release.

    Returns:
        A [`variational.chatter.ComposedMap`][].

    Raises:
        ValueError: The system has no period.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import composed_map
        >>> system = ImpactOscillator(omega=0.6071945, restitution=0.5)
        >>> composed_map(system, "omega", 24, phase=0.35).matrix.shape
        (2, 2)
    """
    check_chatter_system(system)
    system = as_arrays(system)
    value = jnp.asarray(pick(where, system)(system), jnp.float64)
    return _compose(line(system, where), value, jnp.asarray(rank), phase)


@program
def _compose(along, value, rank, phase) -> ComposedMap:
    def turn(value):
        moved = along.at(value).prepared()
        period = moved.period
        frame = prepared_frame(moved, jnp.asarray(phase * period, jnp.float64))
        zero = jnp.zeros(())
        point = impact_after(moved, frame.release, frame.state, zero, 0.0, rank)
        # this impact follows the release of the frame; D* is the same one a period
        # earlier
        return moved, frame, point.time - period, point.speed

    def section_of(moved, frame, velocity):
        """Return derivatives of state, gap and velocity at the section with respect to
        the velocity at release.
        """
        direction = normal_directions(moved, frame.release, frame.state)[0]
        start = frame.state + velocity * direction
        section = (phase + 1) * moved.period
        state, *relative = fly(
            moved, frame.release, start, velocity, section - frame.release
        )
        return state, jnp.stack(relative)

    def by_value(value):
        moved, frame, time, speed = turn(value)
        lam = frame.coordinate(time, speed)
        distance = lam - scaling_law(frame.restitution).lambda_bar
        relative = section_of(moved, frame, jnp.zeros(()))[1]
        return distance, frame.release, frame.jerk, relative

    rates = jax.jvp(by_value, (value,), (jnp.ones_like(value),))[1]
    incidence, release_rate, jerk_rate, drift = rates
    moved, frame, time, speed = turn(value)
    state, relative = section_of(moved, frame, jnp.zeros(()))
    by_velocity = jax.jvp(
        lambda v: section_of(moved, frame, v), (jnp.zeros(()),), (jnp.ones(()),)
    )[1]

    def theta(y):
        point = section_to_impact(moved, y, phase, rank)
        return jnp.stack([point.speed, point.time])

    lam = frame.coordinate(time, speed)
    covector = frame.gradient(time, speed)
    return ComposedMap(
        frame=frame,
        section=(phase + 1) * moved.period,
        state=state,
        relative=relative,
        time=time,
        speed=speed,
        lam=lam,
        lambda_bar=scaling_law(frame.restitution).lambda_bar,
        matrix=jax.jacfwd(theta)(state),
        vector=frame.jerk * by_velocity[0],
        relative_vector=frame.jerk * by_velocity[1],
        covector=covector,
        by_parameter=-lam * jerk_rate / frame.jerk - covector[1] * release_rate,
        incidence=incidence,
        drift=drift,
    )


def simulated_at_section(
    system: HybridSystem, composed: ComposedMap, speed
) -> SectionArrival:
    """Compute the exact motion that `ComposedMap.at_section` predicts locally.

    Args:
        system: The system at the interruption.
        composed: The local theory of the system.
        speed: Changes of the rebound speed of D*, shape `(k,)`.

    Returns:
        A [`variational.chatter.SectionArrival`][] with a leading axis.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import composed_map, simulated_at_section
        >>> system = ImpactOscillator(omega=0.6071945, restitution=0.5)
        >>> composed = composed_map(system, "omega", 24, phase=0.35)
        >>> simulated_at_section(system, composed, jnp.zeros(2)).gap.shape
        (2,)
    """
    system = as_arrays(system).prepared()
    speeds = composed.speed + jnp.asarray(speed, jnp.float64)
    frame, section = composed.frame, composed.section
    return _simulated(system, frame, composed.time, speeds, section)


def simulated_by_parameter(
    system: HybridSystem, where: Where, changes, phase=0.0
) -> SectionArrival:
    """Follow the orbit from release over a period at other parameter values.

    [`variational.chatter.ComposedMap.along_parameter`][] is the local prediction of the
    result.

    Args:
        system: The system at the interruption.
        where: Selects the parameter.
        changes: Changes of the parameter, shape `(k,)`.
        phase: Phase of the section, in periods.

    Returns:
        A [`variational.chatter.SectionArrival`][] with a leading axis, at the section
            after the next release.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational.chatter import simulated_by_parameter
        >>> system = ImpactOscillator(omega=0.6071945, restitution=0.5)
        >>> changes = jnp.array([-1e-4, 1e-4])
        >>> arrivals = simulated_by_parameter(system, "omega", changes, phase=0.35)
        >>> arrivals.stuck.tolist()  # chatter is complete only below the interruption
        [True, False]
    """
    system = as_arrays(system)
    value = jnp.asarray(pick(where, system)(system), jnp.float64)
    return _moved(line(system, where), value + jnp.asarray(changes), phase)


@program
def _moved(along, values, phase):
    def one(value):
        system = along.at(value).prepared()
        period = system.period
        frame = prepared_frame(system, jnp.asarray(phase * period, jnp.float64))
        zero, yes = jnp.zeros(()), jnp.asarray(True)
        start = ImpactPoint(frame.release, frame.state, zero, zero, yes)
        later = eqx.tree_at(lambda f: f.release, frame, frame.release + period)
        return to_section(system, later, start, (phase + 2) * period)

    return jax.vmap(one)(values)


@program
def _simulated(system, frame, time, speeds, section):
    def one(speed):
        state = surface_state(system, time, speed)
        start = ImpactPoint(time, state, speed, -speed, jnp.asarray(True))
        return to_section(system, frame, start, section)

    return jax.vmap(one)(speeds)
