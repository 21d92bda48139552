"""Motion programs, the cams that give them, and what holds the follower on them."""

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest

from jaxcam import simulate
from jaxcam.hybrid.surface import release_point
from jaxcam.models import (
    CamFollower,
    ConstantRestitution,
    contact_force,
    contact_load,
    DesmodromicCam,
    EccentricCircle,
    flat_oscillating_contour,
    flat_translating_contour,
    float_speed,
    FourierProfile,
    MotionProgram,
    preset,
    rad_s_to_rpm,
    roller_oscillating_contour,
    roller_translating_contour,
    Segment,
    simulate_through_joints,
    ValveTrain,
)
from jaxcam.models.cams import MOTION_LAWS
from jaxcam.plotting import cam_contour, motion_program


TURN = 2 * np.pi
ANGLES = np.linspace(0.0, TURN, 241)
# Figure 4.5: function, start and end (degrees), and the sign of the rise
FIGURE_4_5 = [
    ("constant velocity", 0, 60, 1.0),
    ("dwell", 60, 90, 0.0),
    ("constant acceleration", 90, 150, -1.0),
    ("dwell", 150, 180, 0.0),
    ("cubic", 180, 240, 1.0),
    ("dwell", 240, 270, 0.0),
    ("simple harmonic", 270, 330, -1.0),
    ("dwell", 330, 360, 0.0),
]
# derivative of each law that is the first not to vanish at its ends
FIRST_JUMP = {
    "constant velocity": 1,
    "constant acceleration": 2,
    "cubic": 2,
    "simple harmonic": 2,
    "cycloidal": 3,
    "3-4-5": 3,
    "4-5-6-7": 4,
    "modified sine": 3,
}
# largest velocity, acceleration of a unit rise over a unit angle (Norton, 2002)
PEAKS = {
    "constant velocity": (1.0, 0.0),
    "constant acceleration": (2.0, 4.0),
    "cubic": (1.5, 6.0),
    "simple harmonic": (np.pi / 2, np.pi**2 / 2),
    "cycloidal": (2.0, 2 * np.pi),
    "3-4-5": (15 / 8, 10 / np.sqrt(3)),
    "4-5-6-7": (35 / 16, 84 * np.sqrt(5) / 25),
    "modified sine": (4 * np.pi / (4 + np.pi) * 0.985, 4 * np.pi**2 / (4 + np.pi)),
}


def largest(values):
    return np.max(np.abs(values))


def rise_and_fall(law, lift=0.01):
    """A double dwell cam: dwell, rise, dwell, fall, a quarter of a turn each."""
    quarter = TURN / 4
    return MotionProgram(
        [
            Segment("dwell", quarter),
            Segment(law, quarter, lift),
            Segment("dwell", quarter),
            Segment(law, quarter, -lift),
        ]
    )


@pytest.fixture(scope="module")
def figure_4_5():
    return MotionProgram(
        [
            Segment(law, np.deg2rad(end - start), rise)
            for law, start, end, rise in FIGURE_4_5
        ]
    )


def test_table_of_figure_4_5(figure_4_5):
    """Start and end angles, and lifts 0 and 1 in the dwells, to rounding."""
    ends = np.rad2deg(np.cumsum(figure_4_5.widths))
    assert largest(ends - [row[2] for row in FIGURE_4_5]) < 1e-12
    levels = np.cumsum([row[3] for row in FIGURE_4_5])
    for level, (law, start, end, _) in zip(levels, FIGURE_4_5, strict=True):
        if law == "dwell":
            inside = np.deg2rad(np.linspace(start + 0.5, end - 0.5, 7))
            jets = np.asarray(figure_4_5.derivatives(jnp.asarray(inside)))
            assert largest(jets - [level, 0, 0, 0]) < 1e-13


def test_jumps_of_figure_4_5(figure_4_5):
    """Each of its functions jumps where the handbook says, by the printed amount.

    Per radian of 60 degrees: constant velocity 1/b, constant acceleration 4/b^2, cubic
    6/b^2, simple harmonic pi^2/(2 b^2); constant acceleration turns by 8/b^2 inside.
    """
    joints = figure_4_5.joints()
    jumps = {
        round(float(angle)): np.asarray(jump)
        for angle, jump in zip(np.rad2deg(joints.angle), joints.jumps, strict=True)
    }
    b = np.pi / 3
    assert sorted(jumps) == [0, 60, 90, 120, 150, 180, 240, 270, 330]
    assert largest([jump[0] for jump in jumps.values()]) < 1e-14
    for angle, sign in ((0, 1), (60, -1)):
        assert largest(jumps[angle][1] - sign / b) < 1e-13
        assert largest(jumps[angle][2:]) < 1e-12
    expected = {
        90: -4 / b**2,
        120: 8 / b**2,
        150: -4 / b**2,
        180: 6 / b**2,
        240: 6 / b**2,
        270: -(np.pi**2) / (2 * b**2),
        330: -(np.pi**2) / (2 * b**2),
    }
    for angle, jump in expected.items():
        assert abs(jumps[angle][1]) < 1e-13
        assert abs(jumps[angle][2] - jump) < 1e-12


@pytest.mark.parametrize("law", sorted(FIRST_JUMP))
def test_smoothness_and_peaks_of_the_laws(law):
    """Continuous up to the derivative the handbook promises, and no further."""
    program = rise_and_fall(law, lift=1.0)
    jumps = np.asarray(program.joints().jumps)
    ends = np.isin(np.round(np.rad2deg(program.joints().angle)), [90, 180, 270, 0])
    scale = (TURN / 4) ** np.arange(4)
    first = FIRST_JUMP[law]
    assert largest((jumps * scale)[:, :first] * ends[:, None]) < 1e-11
    if first < 4:
        assert np.max(np.abs((jumps * scale)[ends, first])) > 0.5
    grid = jnp.linspace(TURN / 4, TURN / 2, 20001)[:-1]
    peak = np.max(np.abs(np.asarray(program.derivatives(grid)) * scale), axis=0)
    assert peak[0] == pytest.approx(1.0, abs=1e-4)
    if law == "modified sine":
        # its acceleration is continuous, and so is its velocity at both inner joints
        inner = ~ends
        assert largest((jumps * scale)[inner, :3]) < 1e-11
        assert peak[1:3] == pytest.approx((1.760, 5.528), abs=1e-3)
    else:
        assert peak[1:3] == pytest.approx(PEAKS[law], abs=1e-6)


def test_derivatives_are_those_of_the_profile(figure_4_5):
    """Closed-form s, v, a, j against nested differentiation of the lift, inside."""
    angles = jnp.asarray(np.deg2rad(np.arange(1.3, 360.0, 7.1)))
    functions = [figure_4_5]
    for _ in range(3):
        functions.append(jax.grad(functions[-1]))
    nested = jax.vmap(lambda a: jnp.stack([f(a) for f in functions]))(angles)
    given = figure_4_5.derivatives(angles)
    assert largest((nested - given) / (1 + np.abs(nested))) < 1e-12


def test_program_is_differentiable_in_its_segments():
    def lift(rise, width):
        segments = [
            Segment("cycloidal", width, rise),
            Segment("3-4-5", TURN - width, -rise),
        ]
        return MotionProgram(segments)(jnp.asarray(1.0))

    slope = jax.grad(lift, argnums=(0, 1))(0.2, 2.0)
    step = 1e-6
    by_rise = (lift(0.2 + step, 2.0) - lift(0.2 - step, 2.0)) / (2 * step)
    by_width = (lift(0.2, 2.0 + step) - lift(0.2, 2.0 - step)) / (2 * step)
    assert slope[0] == pytest.approx(float(by_rise), abs=1e-9)
    assert slope[1] == pytest.approx(float(by_width), abs=1e-9)


@pytest.mark.parametrize(
    ("segments", "words"),
    [
        ([], "at least one segment"),
        ([Segment("parabola", TURN, 0.0)], "cycloidal"),
        ([Segment("cubic", 3.0, 1.0), Segment("cubic", 3.0, -1.0)], "2 pi"),
        ([Segment("cubic", 180, 1.0), Segment("cubic", 180, -1.0)], "degrees"),
        ([Segment("cubic", np.pi, 1.0), Segment("cubic", np.pi, -0.9)], "to zero"),
        ([Segment("dwell", np.pi, 1.0), Segment("cubic", np.pi, -1.0)], "dwell"),
    ],
)
def test_programs_that_do_not_close_are_refused(segments, words):
    with pytest.raises(ValueError, match=words):
        MotionProgram(segments)


# An eccentric circle is a cam for every follower, with a motion in closed form.
R, E = 0.03, 0.008


def is_circle(contour, center, radius):
    distance = np.hypot(contour.x - center[0], contour.y - center[1])
    assert largest(distance - radius) < 1e-12  # m
    assert largest(contour.radius_of_curvature - radius) < 1e-10  # m


def test_flat_translating_follower_of_a_circle():
    """Lift e (1 - cos a), base radius R - e: the circle about (0, -e)."""
    contour = flat_translating_contour(FourierProfile(E, [-E], [0.0]), R - E, ANGLES)
    is_circle(contour, (0.0, -E), R)


@pytest.mark.parametrize("center_y", [0.0, 0.03])
def test_flat_oscillating_follower_of_a_circle(center_y):
    """The rig's own cam comes back from its contact angle (4.23)."""
    profile = EccentricCircle(center_y=center_y)
    contour = flat_oscillating_contour(profile, ANGLES)
    is_circle(contour, (0.015, 0.0), 0.045)
    # (4.19) with the contact point (4.25)
    lift = np.asarray(profile(jnp.asarray(ANGLES)))
    x = 0.015 * np.cos(ANGLES) + 0.249 - 0.045 * np.sin(lift)
    y = 0.015 * np.sin(ANGLES) + center_y + 0.045 * np.cos(lift)
    arm = np.cos(lift) * x + np.sin(lift) * y
    assert largest(contour.arm - arm) < 1e-14


class RollerOnCircle(eqx.Module):
    """Height of a roller whose centre keeps a distance from an eccentric one."""

    offset: float
    distance: float
    start: float

    def __call__(self, a):
        x, y = -E * jnp.sin(a), E * jnp.cos(a)
        return y + jnp.sqrt(self.distance**2 - (self.offset - x) ** 2) - self.start


@pytest.mark.parametrize("offset", [0.0, 0.005])
def test_roller_followers_of_a_circle(offset):
    """A circle about (0, e), met by a roller that slides, or swings on an arm."""
    roller = 0.01
    start = np.sqrt((R + roller) ** 2 - offset**2)
    profile = RollerOnCircle(offset, R + roller, start)
    contour = roller_translating_contour(profile, R, roller, ANGLES, offset=offset)
    is_circle(contour, (0.0, E), R)
    # the normal at the roller points away from the circle's centre
    y = start + np.asarray(profile(jnp.asarray(ANGLES)))
    across = (offset + E * np.sin(ANGLES)) / (R + roller)
    up = (y - E * np.cos(ANGLES)) / (R + roller)
    assert largest(contour.pressure_angle - np.arctan2(np.abs(across), up)) < 1e-7


def test_roller_on_an_arm():
    pivot, length, roller = (0.1, 0.02), 0.09, 0.01

    def angle(a):
        # triangle of pivot, circle's centre and roller; the roller above the line
        x, y = -E * jnp.sin(a) - pivot[0], E * jnp.cos(a) - pivot[1]
        d2 = x * x + y * y
        cosine = (length**2 + d2 - (R + roller) ** 2) / (2 * length * jnp.sqrt(d2))
        return jnp.mod(jnp.arctan2(y, x), TURN) - jnp.arccos(cosine)

    contour = roller_oscillating_contour(angle, pivot, length, roller, ANGLES)
    is_circle(contour, (0.0, E), R)


def test_undercut_is_seen():
    """A flat face asks for R + s + s'' > 0; a steep rise on a small cam breaks it."""
    program = rise_and_fall("cycloidal", lift=0.02)
    radius = 0.02
    contour = flat_translating_contour(program, radius, ANGLES)
    jets = np.asarray(program.derivatives(jnp.asarray(ANGLES)))
    assert np.min(contour.radius_of_curvature) < 0
    bad = radius + jets[:, 0] + jets[:, 2] <= 0
    assert np.array_equal(np.asarray(contour.radius_of_curvature) <= 0, bad)


# Contact load, and the speed at which it can no longer hold.


@pytest.fixture(scope="module")
def calibrated():
    return preset("calibrated")


def harmonic_valve(speed=100.0, damping=0.0):
    """s = (L/2)(1 - cos a): one harmonic, so that everything is known."""
    return ValveTrain(
        profile=FourierProfile(0.005, [-0.005], [0.0]),
        speed=speed,
        mass=0.2,
        stiffness=30e3,
        preload=250.0,
        damping=damping,
    )


def test_float_speed_of_a_harmonic_cam():
    """m w^2 L/2 = F0 + k L at the top, or anywhere the ratio is least: exact."""
    valve = harmonic_valve()
    found = float_speed(valve)
    # (k L/2 (1 - c) + F0) / (-m (L/2) c) for c in (-1, 0) falls towards c = -1
    top = np.sqrt((250.0 + 30e3 * 0.01) / (0.2 * 0.005))
    assert found.speed == pytest.approx(top, rel=1e-12)
    assert found.cam_angle == pytest.approx(np.pi, abs=1e-6)
    at = eqx.tree_at(lambda s: s.speed, valve, found.speed)
    assert largest(np.min(contact_load(at, ANGLES))) < 1e-10  # N of 550


def test_float_speed_with_damping():
    """A root of the least load at that speed, below it contact holds everywhere."""
    valve = harmonic_valve(damping=60.0)
    speed = float_speed(valve).speed
    fine = np.linspace(0, TURN, 20001)
    at = eqx.tree_at(lambda s: s.speed, valve, speed)
    below = eqx.tree_at(lambda s: s.speed, valve, 0.999 * speed)
    assert abs(np.min(contact_load(at, fine))) < 1e-4  # N; the scan is that coarse
    assert np.min(contact_load(below, fine)) > 0.1


def test_float_speed_of_a_program_with_jumps():
    """Constant acceleration: the fall of acceleration comes at half the rise, one side.

    m w^2 4 L/b^2 = F0 + k s just after half way, where the spring is weakest.
    """
    program = rise_and_fall("constant acceleration")
    valve = eqx.tree_at(lambda s: s.profile, harmonic_valve(), program)
    b = TURN / 4
    exact = np.sqrt((250.0 + 30e3 * 0.005) / (0.2 * 4 * 0.01 / b**2))
    assert float_speed(valve).speed == pytest.approx(exact, rel=1e-12)
    kinked = rise_and_fall("constant velocity")
    valve = eqx.tree_at(lambda s: s.profile, valve, kinked)
    found = float_speed(valve)
    assert found.speed == 0 and found.cam_angle == pytest.approx(np.pi)


def test_float_speed_is_differentiable():
    valve = harmonic_valve()

    def speed(stiffness):
        return float_speed(eqx.tree_at(lambda s: s.stiffness, valve, stiffness)).speed

    slope = jax.jit(jax.grad(speed))(jnp.asarray(30e3))
    assert slope == pytest.approx(
        0.01 / (2 * 0.2 * 0.005 * float(speed(jnp.asarray(30e3)))), rel=1e-9
    )


def test_rig_leaves_its_cam_at_the_printed_speed(calibrated):
    """Detachment at 125 rpm (section 5.2): 125.15 for the calibrated rig."""
    assert rad_s_to_rpm(float_speed(calibrated).speed) == pytest.approx(
        125.15, abs=0.01
    )


def test_loss_of_contact_is_where_the_orbit_is_released(calibrated):
    """Load (4.10) and release from contact by the event loop, rad."""
    release = release_point(calibrated, jnp.asarray(0.0))
    angle = calibrated.cam_angle(release.time)
    load = contact_load(calibrated, angle[None])
    scale = np.max(contact_load(calibrated, ANGLES))
    assert abs(load[0]) < 1e-12 * scale
    # and the force is the torque over the lever of the contact point
    force = contact_force(calibrated, ANGLES)
    arm = flat_oscillating_contour(calibrated.profile, ANGLES).arm
    assert largest(force * arm - contact_load(calibrated, ANGLES)) < 1e-12


def test_contact_force_asks_for_the_axis():
    system = CamFollower(profile=FourierProfile(0.27, [0.03], [0.0]))
    with pytest.raises(ValueError, match="center"):
        contact_force(system, ANGLES)


@pytest.mark.slow
def test_valve_floats_above_its_speed_only():
    """Simulated: contact for the whole turn below, impacts above."""
    limit = float(float_speed(harmonic_valve()).speed)
    for factor, floats in ((0.98, False), (1.02, True)):
        valve = harmonic_valve(speed=factor * limit)
        start = jnp.array([0.0, 0.0])
        run = simulate(valve, start, 0.0, 1.5 * float(valve.period))
        assert run.result == ""
        assert bool(run.impacts.count > 0) == floats


@pytest.mark.slow
def test_desmodromic_follower_stays_between_the_flanks():
    """Far above any float speed it is driven by both flanks, never through one."""
    system = DesmodromicCam(
        profile=rise_and_fall("cycloidal"),
        speed=200.0,
        clearance=2e-4,
        stiffness=500.0,
        preload=5.0,
        restitution=ConstantRestitution(0.3),
    )
    end = 2 * float(system.period)
    run = simulate_through_joints(system, jnp.array([1e-4, 0.0]), 0.0, end)
    assert run.result == ""
    assert np.min(run.gap(jnp.linspace(0.0, end, 2000))) > -1e-12  # m
    assert set(np.asarray(run.impacts.constraint).tolist()) == {0, 1}


# Joints of the program as events.


def test_parabolic_cam_without_a_spring_rate():
    """Thrown off half way up a parabola, lands on the fall: a quadratic equation.

    Constant spring force g m: flight y = y1 + v1 t - g t^2/2 from half way on, where
    the cam turns to a deceleration a > g.
    """
    speed, lift, b = 100.0, 0.01, TURN / 4
    a = 4 * lift * (speed / b) ** 2
    g = 0.5 * a
    valve = ValveTrain(
        profile=MotionProgram(
            [
                Segment("constant acceleration", b, lift),
                Segment("dwell", TURN / 2),
                Segment("constant acceleration", b, -lift),
            ]
        ),
        speed=speed,
        mass=1.0,
        stiffness=0.0,
        preload=g,
        restitution=ConstantRestitution(0.4),
    )
    half = b / 2 / speed
    rise_speed = a * half
    # lands on the dwell: lift/2 + v t - g t^2/2 = lift
    flight = (rise_speed + np.sqrt(rise_speed**2 - g * lift)) / g
    assert half + flight < 3 * b / speed
    run = simulate_through_joints(valve, jnp.zeros(2), 0.0, 0.99 * float(valve.period))
    assert run.result == ""
    assert run.contacts.start[0] == 0
    assert run.contacts.end[0] == pytest.approx(half, rel=1e-12)
    assert run.impacts.time[0] == pytest.approx(half + flight, rel=1e-10)
    landing = rise_speed - g * flight
    assert run.impacts.speed_before[0] == pytest.approx(landing, rel=1e-9)
    # the chatter on the dwell ends where the geometric series does, or the fall begins
    rest = half + flight - 2 * landing * 0.4 / (g * (1 - 0.4))
    fall = 3 * b / speed
    assert rest > fall or run.contacts.start[1] == pytest.approx(rest, rel=1e-9)


def test_kink_upwards_is_an_impact_and_downwards_a_throw(figure_4_5):
    """Constant velocity from rest: rebound r v at the kink, v the cam's velocity."""
    speed, scale = 20.0, 0.01
    program = eqx.tree_at(lambda p: p.rises, figure_4_5, scale * figure_4_5.rises)
    valve = ValveTrain(
        profile=program,
        speed=speed,
        mass=1.0,
        stiffness=0.0,
        preload=60.0,
        restitution=ConstantRestitution(0.5),
        phase=-0.1,
    )
    kick = scale / (np.pi / 3) * speed
    run = simulate_through_joints(valve, jnp.zeros(2), 0.0, 0.04)
    assert run.contacts.end[0] == pytest.approx(0.1 / speed, rel=1e-9)
    assert run.impacts.time[0] == pytest.approx(0.1 / speed, rel=1e-9)
    assert run.impacts.speed_before[0] == pytest.approx(-kick, rel=1e-9)
    # bounces on an incline of constant velocity: a ball on the floor
    rest = 0.1 / speed + 2 * 0.5 * kick / (60.0 * (1 - 0.5))
    assert run.contacts.start[1] == pytest.approx(rest, rel=1e-9)


def test_joints_ask_for_a_program():
    with pytest.raises(ValueError, match="MotionProgram"):
        simulate_through_joints(harmonic_valve(), jnp.zeros(2), 0.0, 0.1)


def test_figures_are_drawn(figure_4_5, tmp_path):
    figure = motion_program(figure_4_5, unit="-")
    axes = figure.axes
    assert len(axes) == 4 and axes[0].get_ylabel().startswith("lift")
    figure.savefig(tmp_path / "program.png")
    contour = flat_oscillating_contour(EccentricCircle(), ANGLES)
    (ax,) = cam_contour(contour).axes
    assert ax.get_aspect() == 1.0
    plt.close("all")


def test_every_law_rises_from_zero_to_one():
    for law in MOTION_LAWS.values():
        if law.name != "dwell":
            jet = np.asarray(rise_and_fall(law, 1.0).derivatives(TURN / 4 + 1e-9))
            assert abs(jet[0]) < 1e-7
