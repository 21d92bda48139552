"""Functions of two numbers made of every public entry, to be transformed by JAX."""

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import jax.numpy as jnp
from jaxtyping import Array, Float
from textbook_systems import BallBetweenWalls, TwoMasses

import jaxcam
import variational
from jaxcam.hybrid import flow
from jaxcam.hybrid.surface import chatter_completion, contact_state, release_point
from jaxcam.models import (
    BeltOscillator,
    BouncingBall,
    CamFollower,
    DesmodromicCam,
    FourierProfile,
    ImpactOscillator,
    PiecewiseLinear,
    PowerLawRestitution,
    RelayFeedback,
    TripleIntegrator,
    ValveTrain,
)


SHARP = jaxcam.Settings(tolerance=1e-12, solver=diffrax.Dopri8())


class Ball(jaxcam.HybridSystem):
    """The ball of the FAQ."""

    gravity: float = 9.81
    restitution: float = 0.8

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.gravity])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


class Spring(jaxcam.HybridSystem):
    """The spring of the FAQ."""

    wall: float = 0.9
    restitution: float = 1.0

    def vector_field(self, t, state):
        return jnp.stack([state[1], -state[0]])

    def gap(self, t, state):
        return self.wall - state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


class Pendulum(jaxcam.HybridSystem):
    """The pendulum of the README."""

    gravity: float = 9.81
    length: float = 0.5
    restitution: float = 0.7
    wall: float = 0.2

    def vector_field(self, t, state):
        angle, rate = state
        return jnp.stack([rate, -self.gravity / self.length * jnp.sin(angle)])

    def gap(self, t, state):
        return state[0] - self.wall

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


class Case(NamedTuple):
    """What is transformed, and where."""

    function: Callable[[Float[Array, " 2"]], Float[Array, " k"]]
    point: Float[Array, " 2"]
    #: the same without any transformation, where there is another path
    untraced: Callable[[Float[Array, " 2"]], Float[Array, " k"]] | None = None


class Motion(NamedTuple):
    """A system with a parameter, a start with another number, and when it ends (s)."""

    system: Callable[[Any], Any]
    start: Callable[[Any], Any]
    point: tuple[float, float]
    end: float


def _ball_between_walls(r):
    return BallBetweenWalls(jnp.asarray(9.81), jnp.asarray(1.0), r)


def _two_masses(r):
    one, damping = jnp.asarray(1.0), jnp.asarray(0.1)
    return TwoMasses(one, 0.2 * one, r, one, one, damping)


def _valve(mass):
    profile = FourierProfile(0.005, [-0.005], [0.0])
    return ValveTrain(profile, 100.0, mass=mass, stiffness=30e3, preload=250.0)


def _desmodromic(clearance):
    profile = FourierProfile(0.005, [-0.005], [0.0])
    return DesmodromicCam(profile, 200.0, clearance, stiffness=500.0, preload=5.0)


def _from(height, *rest):
    return jnp.stack([height, *(jnp.asarray(r) for r in rest)])


def _power_law(r):
    return CamFollower(restitution=PowerLawRestitution(r, 0.3, 0.2))


MOTIONS = {
    "faq-ball": Motion(
        lambda r: Ball(restitution=r), lambda h: _from(h, 0.0), (0.7, 1.0), 1.3
    ),
    "faq-spring": Motion(
        lambda w: Spring(wall=w), lambda v: _from(0.0 * v, v), (0.9, 1.0), 3.0
    ),
    "readme-pendulum": Motion(
        lambda r: Pendulum(restitution=r), lambda a: _from(a, 0.0), (0.7, 1.0), 1.0
    ),
    "bouncing-ball": Motion(
        lambda r: BouncingBall(restitution=r, amplitude=0.02, frequency=20.0),
        lambda h: _from(h, 0.0),
        (0.7, 0.5),
        0.7,
    ),
    "oscillator": Motion(
        lambda r: ImpactOscillator(restitution=r, wall=0.1, damping=0.05),
        lambda x: _from(x, 0.3),
        (0.8, -0.4),
        3.0,
    ),
    "triple-integrator": Motion(
        lambda r: TripleIntegrator(restitution=r),
        lambda x: _from(x, 0.0, -1.0),
        (0.6, 0.1),
        0.8,
    ),
    "cam": Motion(
        lambda k: CamFollower(stiffness=k), lambda x: _from(x, 0.0), (105.0, 0.35), 0.3
    ),
    "cam-power-law": Motion(_power_law, lambda x: _from(x, 0.0), (0.55, 0.35), 0.3),
    "valve": Motion(_valve, lambda x: _from(x, 0.0), (0.2, 0.002), 0.006),
    "desmodromic": Motion(_desmodromic, lambda x: _from(x, 0.0), (2e-4, 1e-4), 0.01),
    "two-walls": Motion(_ball_between_walls, lambda x: _from(x, 12.0), (0.9, 0.3), 0.3),
    "two-masses": Motion(
        _two_masses, lambda x: _from(x, 0.1, 0.5, 0.0), (0.7, 0.0), 1.5
    ),
}


def _simulated(motion: Motion, **options):
    """Final state, time of the first impact, and states between points of the run."""
    # short steps, so that a sample hardly depends on which of them it is in
    short = jaxcam.Settings(
        tolerance=1e-12, solver=diffrax.Dopri8(), max_step=motion.end / 64
    )

    def function(p):
        run = jaxcam.simulate(
            motion.system(p[0]),
            motion.start(p[1]),
            0.0,
            motion.end,
            settings=short,
            **options,
        )
        between = jnp.asarray([0.3 * motion.end, 0.83 * motion.end])
        parts = [run.final, run.impacts.time[:1], run.at(between), run.gap(between)]
        return jnp.concatenate([jnp.ravel(part) for part in parts])

    return function


def _simulate(name: str) -> Case:
    motion = MOTIONS[name]
    traced = _simulated(motion, max_steps=256)
    return Case(traced, jnp.asarray(motion.point), _simulated(motion))


def _flow(name: str) -> Case:
    motion = MOTIONS[name]

    def function(p):
        start = motion.start(p[1])
        system = motion.system(p[0])
        end = flow(system, start, 0.0, motion.end, settings=SHARP, max_steps=256)
        return end.state

    def untraced(p):
        start = motion.start(p[1])
        system = motion.system(p[0])
        return jaxcam.simulate(system, start, 0.0, motion.end, settings=SHARP).final

    return Case(function, jnp.asarray(motion.point), untraced)


def _filippov(name: str) -> Case:
    def belt(p):
        return BeltOscillator(friction=p[0]), _from(p[1], 0.0), 3.0

    def halves(p):
        minus = jnp.asarray([[0.0, 1.0], [-1.0, -0.1]])
        plus = minus.at[1, 0].set(-p[0])
        system = PiecewiseLinear(minus, plus, jnp.asarray([1.0, 0.0]))
        return system, _from(p[1], 1.0), 4.0

    def relay(p):
        matrix = jnp.asarray([[0.0, 1.0], [-1.0, -0.5]])
        vector = jnp.stack([0.0 * p[0], p[0]])
        system = RelayFeedback(matrix, vector, jnp.asarray([1.0, 1.0]))
        return system, _from(p[1], 1.0), 3.0

    made, point = {
        "belt": (belt, (1.0, 1.5)),
        "piecewise": (halves, (2.0, -1.0)),
        "relay": (relay, (0.5, 1.0)),
    }[name]

    def function(p):
        system, start, end = made(p)
        end = flow(system, start, 0.0, end, settings=SHARP, max_steps=256)
        return end.state

    return Case(function, jnp.asarray(point))


def _orbit():
    """The orbit with one impact a period of (omega, r) = (2.8, 0.8), wall 0."""
    system = ImpactOscillator(omega=2.8, restitution=0.8)
    period = float(system.period)
    gamma, half = 1 / (1 - 2.8**2), period / 2
    # x = gamma cos(theta) and x' at the impact; see `closed_form` in the orbits' tests
    k, m = (1 + 0.8) / jnp.tan(half) / 2, (1 - 0.8) / (2 * 2.8)
    speed = jnp.abs(gamma) / jnp.sqrt(k**2 + m**2)
    phase = jnp.arctan2(-m * speed / gamma, k * speed / gamma)
    after = jnp.stack([jnp.zeros(()), -0.8 * speed])
    return variational.orbit_of(system, after, t0=phase / 2.8)


def _monodromy(method: Any) -> Case:
    orbit = _orbit()

    def function(p):
        system = ImpactOscillator(omega=2.8, restitution=p[0], damping=p[1])
        return jnp.ravel(variational.monodromy(system, orbit, method=method))

    return Case(function, jnp.asarray((0.8, 0.05)))


def _theory(name: str) -> Case:
    """Entries that take a system and are no run."""
    cam = CamFollower().prepared()

    def saltation(p):
        before = jnp.stack([jnp.asarray(0.2), -p[1]])
        return jnp.ravel(
            variational.saltation_matrix(Pendulum(restitution=p[0]), 0.3, before)
        )

    def completion(p):
        state = jnp.stack([jnp.zeros(()), p[1], jnp.asarray(-1.0)])
        end = chatter_completion(TripleIntegrator(restitution=p[0]), 0.0, state)
        return jnp.concatenate([end.time[None], end.state, end.smallness[None]])

    def release(p):
        point = release_point(CamFollower(speed=p[0]), p[1])
        return jnp.concatenate([point.time[None], point.state])

    def contact(p):
        cam = CamFollower(speed=p[0])
        return jnp.ravel(contact_state(cam, p[1][None], jnp.zeros(2)))

    def released(p):
        run = jaxcam.simulate(
            CamFollower(speed=p[0]), None, 0.0, p[1], settings=SHARP, max_steps=256
        )
        return run.final

    def flight(p):
        start = jnp.stack([p[1], jnp.asarray(1.0)])
        end = variational.chatter.fly(Ball(gravity=p[0]), 0.0, start, 1.0, 0.3, p[1])
        return jnp.concatenate([end[0], end[1][None], end[2][None]])

    def impact(p):
        ball = BouncingBall(restitution=p[0], amplitude=0.02, frequency=20.0)
        start = jnp.stack([jnp.zeros(()), p[1]])
        point = variational.chatter.next_impact(ball, 0.0, start, p[1] - 0.4, 3.0)
        return jnp.concatenate([point.time[None], point.state, point.speed[None]])

    def turn(p):
        moved = CamFollower(stiffness=p[0])
        at = jnp.stack([p[1], jnp.asarray(0.0)])
        return variational.section_turn(moved, at, 0.1).state

    def poincare(p):
        def field(x):
            # the unit circle attracts at a rate 2 p0; a turn takes 2 pi / p1
            radius = jnp.sum(x**2)
            return jnp.stack(
                [
                    p[0] * x[0] * (1 - radius) - p[1] * x[1],
                    p[0] * x[1] * (1 - radius) + p[1] * x[0],
                ]
            )

        start, turn = jnp.asarray([1.0, 0.0]), 2 * jnp.pi / p[1]
        return jnp.ravel(
            variational.poincare_derivative(field, lambda x: x[1], start, turn)
        )

    speed = float(cam.speed)
    made: dict[str, tuple[Callable, tuple[float, float]]] = {
        "saltation_matrix": (saltation, (0.7, 1.5)),
        "chatter_completion": (completion, (0.6, 0.01)),
        "release_point": (release, (speed, 0.3)),
        "contact_state": (contact, (speed, 0.3)),
        "simulate-released": (released, (speed, 0.3)),
        "fly": (flight, (9.81, 1.0)),
        "next_impact": (impact, (0.7, 1.5)),
        "section_turn": (turn, (105.0, 0.35)),
        "poincare_derivative": (poincare, (0.2, 1.5)),
    }
    function, point = made[name]
    return Case(function, jnp.asarray(point))


FILIPPOV = ("belt", "piecewise", "relay")
THEORY = (
    "saltation_matrix",
    "chatter_completion",
    "release_point",
    "contact_state",
    "simulate-released",
    "fly",
    "next_impact",
    "section_turn",
    "poincare_derivative",
)
GROUPS = (
    *(f"simulate:{name}" for name in MOTIONS),
    *(f"flow:{name}" for name in MOTIONS),
    *(f"filippov:{name}" for name in FILIPPOV),
    *(f"theory:{name}" for name in THEORY),
    "monodromy:flow",
    "monodromy:product",
)


def case_of(group: str) -> Case:
    """The case of one of `GROUPS`."""
    entry, name = group.split(":")
    makers: dict[str, Callable[[str], Case]] = {
        "simulate": _simulate,
        "flow": _flow,
        "filippov": _filippov,
        "monodromy": _monodromy,
        "theory": _theory,
    }
    return makers[entry](name)
