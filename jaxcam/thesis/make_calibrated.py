"""Recover the parameters of the rig of the thesis from Tables 5.2 and 6.1.

Table 4.4 is rounded, the spring was refitted afterwards, and the thesis gives neither
the restitution law nor the sense of rotation. This module recovers all of these:

1. Free flight is conservative, so the product of the two multipliers of P(1,1) is r^2.
   The law is a straight line through the ten values of r from Table 5.2.
2. Seven parameters start at their values in Table 4.4, with a tolerance of 2 %, and are
   fitted to the sums of the multipliers from 147.9 to 153.4 rpm and to Table 6.1.
3. Both senses of rotation are tried. Only one fits.

Run it as `python -m jaxcam.thesis.make_calibrated` to print the parameters of
`preset("calibrated")`.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from variational import impact_orbit, orbit_trace, release_near
from variational.orbits import flight_end

from ..fitting import fit_published, Published
from ..fitting.published import PublishedFit, rounding_error
from ..hybrid.surface import contact_state, release_point
from ..models import CamFollower, LinearInSpeed, rad_s_to_rpm, rpm_to_rad_s
from .chapter_5_bifurcations import table_5_2
from .chapter_6_chattering import table_6_1
from .orbits import first_orbit, NEAR_CAM
from .speeds import at_rpm, speed_of


TOLERANCE = 0.02
"""Relative tolerance of the values in Table 4.4."""
TRACE_ERROR = 1e-6
"""Error of a printed sum of multipliers: the values have twelve digits, but come from
AUTO, whose orbits are usually converged to 1e-6 or 1e-7.
"""

NAMES = (
    "eccentricity",
    "center_y",
    "radius",
    "stiffness",
    "spring_half_height",
    "spring_hook_x",
    "spring_elongation",
    "phase",
    "accumulation time",
)


class Observed(eqx.Module):
    """The rig, and the time of the first row of Table 6.1.

    The time is printed with five digits, fewer than the accuracy of angle and velocity
    requires, so it is an additional unknown.
    """

    system: CamFollower
    accumulation: Float[Array, ""]


class Law(NamedTuple):
    """Coefficient of restitution as a function of speed, and the residuals of the ten
    values.
    """

    law: LinearInSpeed
    residuals: Float[np.ndarray, " rows"]


def restitution_law() -> Law:
    """Fit a line to the square roots of the products of the multipliers."""
    r = np.sqrt(table_5_2.PRODUCTS)
    slope, intercept = np.polyfit(table_5_2.SPEEDS, r, 1)
    law = LinearInSpeed(slope=rad_s_to_rpm(slope), intercept=intercept)
    return Law(law, r - np.polyval([slope, intercept], table_5_2.SPEEDS))


def nominal_rig(rotation: str = "clockwise") -> CamFollower:
    """Return the rig of Table 4.4 with the fitted law, and time zero at the largest
    lift.

    The last column of Table 6.1 implies this time origin: relative and absolute
    velocity agree at the end of the period, so the lift has zero velocity there.
    """
    system = CamFollower(restitution=restitution_law().law, rotation=rotation)
    angles = jnp.linspace(0.0, 2 * jnp.pi, 4097)
    highest = angles[jnp.argmax(jax.vmap(system.contact_angle)(angles))]
    phase = highest if rotation == "counterclockwise" else -highest
    return eqx.tree_at(lambda s: s.phase, system, jnp.mod(phase, 2 * jnp.pi))


def free(observed: Observed):
    """Return the fitted numbers in the order of `NAMES`; x0 and J only set scales and
    are fixed.
    """
    system = observed.system
    return [
        system.profile.eccentricity,  # pyright: ignore
        system.profile.center_y,  # pyright: ignore
        system.profile.radius,  # pyright: ignore
        system.stiffness,
        system.spring_half_height,
        system.spring_hook_x,
        system.spring_elongation,
        system.phase,
        observed.accumulation,
    ]


def tolerances(system: CamFollower) -> list[float]:
    """Return 2 % of each nominal value; y0, which is zero, has the tolerance of x0.

    Only the sum of the cam radius and the follower's half height is identifiable, so
    the radius has the tolerance of the sum. The phase and the accumulation time have no
    tolerance.
    """
    cam = system.profile
    sizes = [
        cam.eccentricity,  # pyright: ignore
        cam.center_x,  # pyright: ignore
        cam.radius + cam.half_height,  # pyright: ignore
        system.stiffness,
        system.spring_half_height,
        system.spring_hook_x,
        system.spring_elongation,
    ]
    return [TOLERANCE * abs(float(size)) for size in sizes] + [np.inf, np.inf]


def published(system: CamFollower) -> list[Published]:
    """Return the values of Tables 5.2 and 6.1 with functions that compute them near
    `system`.

    Raises:
        ValueError: The rig has no P(1,1) at 148 rpm to start from.
    """
    guess = first_orbit(system)
    if guess is None:
        raise ValueError("The rig has no orbit with one impact per cycle at 148 rpm.")
    far = ~table_5_2.NEAR_FOLD
    speeds = jnp.asarray(rpm_to_rad_s(table_5_2.SPEEDS[far]))
    point = release_point(
        at_rpm(system, table_6_1.CHATTER_SPEED), 60 / table_6_1.CHATTER_SPEED
    )

    def traces(model: Observed):
        def one(speed):
            moved = eqx.tree_at(speed_of, model.system, speed)
            return orbit_trace(moved, impact_orbit(moved, guess))

        return jax.vmap(one)(speeds)

    def released(model):
        moved = at_rpm(model.system, table_6_1.CHATTER_SPEED)
        return moved, *release_near(moved, point.time, point.state)

    def release(model):
        _, time, state = released(model)
        return jnp.append(time, state)

    def accumulation(model):
        moved = at_rpm(model.system, table_6_1.CHATTER_SPEED)
        time = model.accumulation
        state = contact_state(moved, time[None], jnp.array(NEAR_CAM))[0]
        return jnp.append(time, state)

    def section(model):
        moved, time, state = released(model)
        end = moved.period
        follower = flight_end(moved, time, state, end, steps=32)
        cam = contact_state(moved, end[None], jnp.array(NEAR_CAM))[0]
        return jnp.concatenate([follower, follower - cam])

    error = rounding_error(table_6_1.DECIMALS)
    relative = [*table_6_1.SECTION_STATE, *table_6_1.SECTION_RELATIVE]
    return [
        Published("sum of multipliers", traces, table_5_2.TRACES[far], TRACE_ERROR),
        Published("release", release, table_6_1.RELEASE, error),
        Published("accumulation", accumulation, table_6_1.ACCUMULATION, error),
        Published("section", section, relative, error),
    ]


def fit_rig(rotation: str = "clockwise", max_steps: int = 512) -> PublishedFit:
    """Fit seven parameters of the rig, its phase, and the accumulation time to Tables
    5.2 and 6.1.
    """
    nominal = nominal_rig(rotation)
    start = Observed(nominal, jnp.asarray(table_6_1.ACCUMULATION[0]))
    return fit_published(
        start,
        free,
        published(nominal),
        names=NAMES,
        tolerances=tolerances(nominal),
        max_steps=max_steps,
    )


def main() -> None:
    """Print the fit and the parameters of the preset."""
    law = restitution_law()
    print(f"largest residual of r: {np.max(np.abs(law.residuals)):.1e}")
    for rotation in ("counterclockwise", "clockwise"):
        fit = fit_rig(rotation)
        print(
            f"\n{rotation}: chi-square {fit.chi_square:.4g}, {fit.steps} steps, "
            f"{'converged' if fit.converged else 'not converged'}"
        )
        print(fit.parameters().to_string(), fit.numbers().to_string(), sep="\n")
        print(*fit.weak(), sep="\n")
        for name, value in zip(NAMES[:-1], fit.estimates, strict=False):
            print(f"{name}={float(f'{value:.13g}')!r}")
    print(f"slope={float(law.law.slope)!r}, intercept={float(law.law.intercept)!r}")


if __name__ == "__main__":
    main()
