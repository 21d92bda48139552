"""Compute the release from sticking, and the coordinates of chatter around it."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam import HybridSystem
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import (
    contact_acceleration,
    normal_acceleration,
    release_point,
    restitution_coefficients,
    sticking_field,
)
from jaxcam.parameters import as_arrays, unit_tangent, Where

from ._beta_map import beta_parts
from ._scalar import check_chatter_system


# number of samples per period of the contact acceleration, from which a time without
# contact is found
_SAMPLES = 256


class ChatterFrame(eqx.Module):
    """The release point of a sticking orbit, and the scales of chatter close to it.

    Arguments of the methods are times of the system; tau is the time since `release`.
    """

    release: Float[Array, ""]
    """Time of release (s); phi_alpha of the thesis, expressed as a time."""
    state: Float[Array, " n"]
    """State at release, shape `(n,)`."""
    jerk: Float[Array, ""]
    """Rate c of the relative acceleration at release, > 0 (thesis, eqs. 6.76 and
    6.112).
    """
    restitution: Float[Array, ""]
    """Coefficient of restitution of slow impacts at release."""

    def coordinate(self, time, speed) -> Float[Array, "..."]:
        """Return lambda = v / (c tau^2) of an impact (thesis, eqs. 6.84 and 6.98).

        Args:
            time: Time of the impact (s).
            speed: Rebound speed v.

        Returns:
            Lambda, dimensionless, in the broadcast shape.

        Examples:
            >>> from jaxcam.models import ImpactOscillator
            >>> from variational import chatter_frame
            >>> frame = chatter_frame(ImpactOscillator(omega=0.5, restitution=0.5))
            >>> lam = frame.coordinate(frame.release - 2.0, speed=0.1)
            >>> round(float(lam), 6)  # v / (c tau^2) with c = omega
            0.05
        """
        tau = time - self.release
        return speed / (self.jerk * tau * tau)

    def gradient(self, time, speed) -> Float[Array, "2"]:
        """Return C = (C1, C2), the derivatives of lambda with respect to rebound speed
        and time.

        Args:
            time: Time of the impact (s).
            speed: Rebound speed.

        Returns:
            The derivatives, shape `(2,)` (thesis, eq. 6.100).
        """
        tau = time - self.release
        first = 1 / (self.jerk * tau * tau)
        return jnp.stack([first, -2 * speed * first / tau])

    def at_section(self, time, speed, section) -> Float[Array, "2"]:
        """Return gap and normal velocity at a section after the last impact.

        Args:
            time: Time of the last impact before release (s).
            speed: Rebound speed of that impact.
            section: Time of the section, after release (s).

        Returns:
            Gap and velocity, shape `(2,)` (thesis, eqs. 6.94-6.96); unlike in eq. 6.55,
                the term of third order in the time of the impact relative to release is
                retained.
        """
        tau, after = time - self.release, section - self.release
        parts = beta_parts(self.coordinate(time, speed), self.restitution)
        deviation = parts.beta * tau * tau
        gap = after**3 / 6 + deviation * after + parts.gamma * tau**3
        return self.jerk * jnp.stack([gap, after * after / 2 + deviation])


def chatter_frame(system: HybridSystem, time=0.0) -> ChatterFrame:
    """Return the release point and the scales of chatter, differentiable in the
    parameters.

    Args:
        system: A system with two states, one constraint and a period.
        time: The first release at or after this time (s) is returned; this release ends
            the contact that precedes the maximum of the contact acceleration.

    Returns:
        A [`variational.chatter.ChatterFrame`][]; NaN if there is no release in the
            period.

    Raises:
        ValueError: The system has no period.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import chatter_frame
        >>> system = ImpactOscillator(omega=0.5, restitution=0.5)
        >>> round(float(chatter_frame(system).release), 6)  # pi / (2 omega)
        3.141593
    """
    check_chatter_system(system)
    return _frame(as_arrays(system), jnp.asarray(time, jnp.float64))


@program
def _frame(system, time) -> ChatterFrame:
    return prepared_frame(system.prepared(), time)


def prepared_frame(system, time) -> ChatterFrame:
    """Return the frame of a system that is already `prepared`."""
    time = jnp.asarray(time, jnp.float64)
    period = system.period
    grid = time + period * jnp.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
    push = contact_acceleration(system, grid, jnp.zeros(2))
    # contact is impossible where the contact acceleration is largest: take the last
    # release before that time
    found = release_point(system, grid[jnp.argmax(push)])
    release = found.time + jnp.where(found.time < time, period, jnp.zeros_like(period))

    frame = frame_at(system, release, found.state)
    lacking = (found.holds != 0) | (frame.jerk <= 0)
    return eqx.tree_at(lambda f: f.release, frame, jnp.where(lacking, jnp.nan, release))


def frame_at(system, release, state) -> ChatterFrame:
    """Return the frame of a known release of a system that is already `prepared`."""

    def suppressed(t, x):
        return normal_acceleration(system, t, x)[0]

    # jvp and not grad, because the functions that use the jerk are differentiated again
    _, jerk = jax.jvp(
        suppressed,
        (release, state),
        (jnp.ones_like(release), sticking_field(system, release, state)),
    )
    return ChatterFrame(
        release=release,
        state=state,
        jerk=jerk,
        restitution=restitution_coefficients(system, release, state)[0],
    )


def parameter_incidence(system: HybridSystem, where: Where, time=0.0) -> ChatterFrame:
    """Return the derivatives of the release point and the scales with respect to a
    parameter.

    In the result, `release` is the derivative of the release time and `jerk` that of
    the jerk c at release (thesis, eqs. 6.114 and 6.115, where they are estimated from
    perturbed simulations).

    Args:
        system: A system with two states, one constraint and a period.
        where: Selects the parameter.
        time: As in [`variational.chatter_frame`][].

    Returns:
        A [`variational.chatter.ChatterFrame`][] of derivatives, in the units of the
            frame divided by that of the parameter.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational.chatter import parameter_incidence
        >>> system = ImpactOscillator(omega=0.5, restitution=0.5)
        >>> rates = parameter_incidence(system, "omega")
        >>> round(float(rates.release), 6)  # release is at pi / (2 omega)
        -6.283185
        >>> round(float(rates.jerk), 6)  # the jerk is omega
        1.0
    """
    system = as_arrays(system)
    along = unit_tangent(where, system)
    time = jnp.asarray(time, jnp.float64)
    return eqx.filter_jvp(lambda s: _frame(s, time), (system,), (along,))[1]
