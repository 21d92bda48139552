"""Terms change what they say, and nothing while their strengths are zero."""

from types import SimpleNamespace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.cli._parameters import assign_parameters, parameters
from jaxcam.cli._source import make_system, Source
from jaxcam.discrepancy import diagnose, library, Policy, strength, Term
from jaxcam.discrepancy.search import _search, _trials, added_gain, given_up
from jaxcam.discrepancy.terms import saved_classes, Value, Where, WithTerms
from jaxcam.discrepancy.terms._library import (
    CamProfileError,
    CoulombFriction,
    ExternalVibration,
    NonlinearSpring,
    QuadraticDrag,
    RestitutionVelocity,
    ViscousDamping,
)
from jaxcam.fitting import Sensor
from jaxcam.fitting.engine import Point
from jaxcam.models import CamFollower, ConstantRestitution, load_system, save_system
from jaxcam.models.saved import system_from_json, system_to_json
from jaxcam.recordings import Recording, References, segment


BASE = CamFollower(speed=15.0, phase=0.3, restitution=ConstantRestitution(0.6))
TIME = jnp.asarray(0.123)
_POLICY = Policy()


def _state(velocity):
    """On the cam, with a velocity of its own."""
    angle = BASE.contact_angle(BASE.cam_angle(TIME))
    return jnp.stack([angle, jnp.asarray(velocity)])


def test_terms_of_no_strength_change_nothing():
    system, state = WithTerms(BASE, library()), _state(-0.7)
    for name in ("vector_field", "gap", "impact"):
        mine, plain = (getattr(s, name)(TIME, state) for s in (system, BASE))
        assert np.asarray(mine) == pytest.approx(np.asarray(plain), abs=1e-14)


@pytest.mark.parametrize(
    ("term", "expected"),
    [
        (ViscousDamping(0.2), lambda q, v: -0.2 * v),
        (CoulombFriction(0.2), lambda q, v: -0.2 * np.sign(v)),
        (QuadraticDrag(0.2), lambda q, v: -0.2 * abs(v) * v),
        (NonlinearSpring(50.0), lambda q, v: -50.0 * (q - 0.27) ** 3),
        (
            ExternalVibration(0.3, 0.1, 30.0),
            lambda q, v: (
                0.3 * np.sin(60 * np.pi * 0.123) + 0.1 * np.cos(60 * np.pi * 0.123)
            ),
        ),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
@pytest.mark.parametrize("velocity", [-0.8, 0.5])
def test_forces_are_those_of_the_table(term, expected, velocity):
    state = _state(velocity)
    change = WithTerms(BASE, (term,)).vector_field(TIME, state) - BASE.vector_field(
        TIME, state
    )
    force = expected(float(state[0]), velocity)
    assert np.asarray(change) == pytest.approx([0.0, force], rel=1e-9)


def test_restitution_falls_with_the_approach_speed():
    state = _state(-0.9)
    system = WithTerms(BASE, (RestitutionVelocity(0.1),))
    # the surface moves; speeds count relative to it
    rest = float(BASE.impact(TIME, state)[1] + 0.6 * state[1]) / 1.6
    approach = abs(-0.9 - rest)
    r = 0.6 * (1 + approach / 0.3) ** -0.1
    after = float(system.impact(TIME, state)[1])
    assert after - rest == pytest.approx(-r * (-0.9 - rest), rel=1e-10)


def test_a_profile_error_moves_the_surface_and_its_rate():
    run, turned = 2e-3, 15.0 * 0.123 + 0.3
    state = _state(-0.9)
    system = WithTerms(BASE, (CamProfileError(run),))
    raised = run * np.cos(2 * turned + 0.7)
    change = float(system.gap(TIME, state) - BASE.gap(TIME, state))
    assert change == pytest.approx(-raised, rel=1e-10)
    rate = -2 * 15.0 * run * np.sin(2 * turned + 0.7)
    plain, moved = BASE.impact(TIME, state)[1], system.impact(TIME, state)[1]
    assert float(moved - plain) == pytest.approx(1.6 * rate, rel=1e-9)


class Raised(Term):
    """A surface that is too high and a force; it states no `acts`."""

    name = "raised"
    height: float = strength("rad", 1e-3)
    push: float = strength("rad/s^2", 0.1)

    def contact(self, motion):
        return self.height

    def acceleration(self, motion):
        return self.push


def test_a_term_acts_where_it_overrides_a_method():
    """Its surface and its force both count, with no `acts` stated."""
    assert Raised.acts == (Where.FLIGHT, Where.CONTACT)
    system, state = WithTerms(BASE, (Raised(1e-3, 0.5),)), _state(-0.7)
    gap = float(system.gap(TIME, state) - BASE.gap(TIME, state))
    assert gap == pytest.approx(-1e-3, abs=1e-12)
    field = system.vector_field(TIME, state) - BASE.vector_field(TIME, state)
    assert np.asarray(field) == pytest.approx([0.0, 0.5], abs=1e-9)
    acts = {term.name: (term.acts, term.where) for term in library()}
    assert acts["cam_profile_error"] == (("contact",), "contact")
    assert acts["restitution_velocity"] == (("impact",), "impact")
    assert acts["viscous_damping"] == (("flight",), "flight")
    assert acts["sensor_lag"] == ((), "sensor")


def test_a_term_is_where_it_acts_unless_it_says_otherwise():
    class Higher(Term):
        def contact(self, motion):
            return 0.0

    class Softer(Higher):
        def restitution(self, approach, motion):
            return 1.0

    assert (Higher.where, Higher.acts) == ("contact", ("contact",))
    assert (Softer.where, Softer.acts) == ("contact", ("contact", "impact"))


def test_a_term_that_misstates_where_it_acts_is_refused():
    with pytest.raises(TypeError, match=r"Wrong declares acts = \('flight',\)"):

        class Wrong(Term):
            acts = ("flight",)

            def contact(self, motion):
                return 0.0

    class Right(Term):
        acts = ("contact",)

        def contact(self, motion):
            return 0.0

    assert Right.acts == (Where.CONTACT,)


class Nowhere(Term):
    """A strength that nothing uses."""

    name = "nowhere"
    size: float = strength("rad", 1.0)


def test_a_candidate_that_acts_nowhere_is_refused():
    """It used to be fitted in vain: a zero column of every information matrix."""
    run = Recording("run", 1e-3 * np.arange(500), {"angle_rad": np.zeros(500)})
    with pytest.raises(ValueError, match="'nowhere' acts nowhere"):
        diagnose(
            BASE,
            [segment(run, "angle_rad", np.zeros(500), noise=1e-4)],
            [Nowhere()],
            sensors={"angle_rad": Sensor(0, noise=1e-4)},
        )


def test_a_model_saved_before_its_terms_had_a_slip_speed_is_read(tmp_path):
    """A file of an earlier version lacks it; other fields are still demanded."""
    system = WithTerms(BASE, (CoulombFriction(0.2),))
    found = system_to_json(system)
    fields = found["system"]["fields"]["terms"]["items"][0]["fields"]
    assert fields.pop("slip") == References().slip_speed
    again = system_from_json(found, classes=saved_classes())
    state = _state(-0.7)
    mine, theirs = (s.vector_field(TIME, state) for s in (system, again))
    assert np.array_equal(np.asarray(mine), np.asarray(theirs))
    fields.pop("fc")
    with pytest.raises(ValueError, match="lacks 'fc'"):
        system_from_json(found, classes=saved_classes())


def test_a_vibration_is_reported_by_amplitude_and_phase():
    """a sin + b cos = sqrt(a^2 + b^2) sin(. + atan2(b, a)), errors to first order."""
    parts = {
        "ext_sin": Value(0.3, 0.03, "rad/s^2"),
        "ext_cos": Value(0.4, 0.04, "rad/s^2"),
        "fe": Value(30.0, 0.1, "Hz"),
    }
    told = ExternalVibration().reported(parts)
    assert told["ext"].value == pytest.approx(0.5)
    assert told["ext"].stderr == pytest.approx(np.hypot(0.6 * 0.03, 0.8 * 0.04))
    assert told["phase"].value == pytest.approx(np.arctan2(0.4, 0.3))
    assert told["phase"].stderr == pytest.approx(
        np.hypot(0.3 * 0.04, 0.4 * 0.03) / 0.25
    )
    assert told["fe"] == parts["fe"]
    one = {"c1": Value(0.1, 0.01, "1/s")}
    assert ViscousDamping().reported(one) == one


def test_a_system_with_terms_flies_as_before():
    """The wrapped system keeps what else the base knows."""
    system = WithTerms(BASE, (ViscousDamping(0.1),))
    assert float(system.period) == pytest.approx(2 * np.pi / 15.0)
    assert system.state_names == BASE.state_names
    moved = eqx.tree_at(lambda s: s.terms[0].c1, system, jnp.asarray(0.3))
    assert float(moved.terms[0].c1) == 0.3


def test_what_the_free_ones_imitate_gains_nothing():
    information = np.array([[4.0, 4.0, 0.0], [4.0, 4.0, 0.0], [0.0, 0.0, 1.0]])
    score = np.array([2.0, 2.0, 3.0])
    alike = _POLICY.distinct_information
    assert added_gain(information, score, np.array([0]), np.array([1]), alike) == 0.0
    both = added_gain(information, score, np.array([0]), np.array([1, 2]), alike)
    assert both == pytest.approx(9.0)


def test_a_diagnosed_system_is_saved_and_read_again(tmp_path):
    """The same field and impact, and what the command line makes of it."""
    terms = (ViscousDamping(0.1), NonlinearSpring(40.0), RestitutionVelocity(0.02))
    system = WithTerms(BASE, terms)
    save_system(system, tmp_path / "model.json")
    again = load_system(tmp_path / "model.json", classes=saved_classes())
    assert isinstance(again, WithTerms)
    state = _state(-0.7)
    for name in ("vector_field", "gap", "impact"):
        mine, theirs = (getattr(s, name)(TIME, state) for s in (system, again))
        assert np.array_equal(np.asarray(mine), np.asarray(theirs))
    assert Source(tmp_path / "model.json").name("") == "cam-follower"
    faster = make_system("cam-follower", None, 150.0, Source(tmp_path / "model.json"))
    assert float(faster.base.speed) == pytest.approx(5 * np.pi)
    assert parameters(faster)["speed"] == pytest.approx(5 * np.pi)
    changed = assign_parameters(faster, ["terms[0].c1=0.3"])
    assert float(changed.terms[0].c1) == 0.3
    with pytest.raises(ValueError, match="WithTerms"):
        load_system(tmp_path / "model.json")


@pytest.mark.usefixtures("unchecked_types")
def test_the_most_promising_exchanges_are_tried(monkeypatch):
    """Of nine terms the six whose scores are highest, whatever order they stand in.

    They once were the first six in the library, and of two terms by their hashes.
    """
    numbers = {f"term {k}": float(10 + k) for k in range(9)}

    class Blocks:
        names = tuple(numbers)
        scale = np.ones(9)

        def total(self):
            return np.eye(9), np.array(list(numbers.values()))

        def rows(self, wanted):
            return np.array([k for k, n in enumerate(self.names) if n in wanted], int)

    class Named:
        def __init__(self, name, inner=False):
            self.name, self.inner = name, inner

        def strengths(self):
            return [Named(self.name)]

    best = SimpleNamespace(names=frozenset(["term 0", "term 1"]), fit=None)
    trials = SimpleNamespace(
        terms=[Named(name) for name in numbers],
        term=Named,
        blocks=lambda trial: Blocks(),
        parameters=lambda names: list(names),
        count=len,
        problem=SimpleNamespace(samples=100),
        policy=_POLICY,
    )
    monkeypatch.setattr(_search, "values_of", lambda fit, blocks: np.zeros(9))
    tried = _search.Search(trials)._exchanges(best)
    wanted = [{kept, f"term {k}"} for k in (8, 7, 6) for kept in ("term 1", "term 0")]
    assert tried == wanted


@pytest.mark.parametrize(
    "costs, crawls",
    [
        # what explains the data is fitted to the end, however slowly
        ([9e3, 119.0, 118.9, 118.8, 118.7, 118.6, 118.5], False),
        # so is what converges: its last steps are small, and each is taken at once
        ([9e5, 1040.0, 775.0, 774.0, 774.0 - 1e-3], False),
        # attempts that fail at first lead somewhere after all
        ([5e4, 5e4, 5e4, 5e4, 5e4, 5e4, 350.0, 350.0, 334.0], False),
        # every other attempt gains next to nothing
        ([9e5, 14000.0, 13950.0, 13950.0, 13900.0, 13900.0], True),
    ],
)
def test_a_fit_that_crawls_far_from_the_data_is_given_up(costs, crawls):
    assert given_up(100, _POLICY)(costs) is crawls


def test_a_fit_that_crawls_goes_on_where_its_cost_decides():
    costs = [9e5, 14000.0, 13950.0, 13950.0, 13900.0, 13900.0]
    assert given_up(100, _POLICY, decides=13800.0)(costs)
    assert not given_up(100, _POLICY, decides=14100.0)(costs)


def test_a_fit_that_is_late_to_beat_another_is_given_up():
    """After eight attempts that always gain, and never enough."""
    costs = [2000.0 * 0.9**k for k in range(16)]
    stop = given_up(100, _POLICY, beaten=100.0)
    assert [stop(costs[: k + 1]) for k in range(1, 10)] == [False] * 7 + [True] * 2
    assert not any(given_up(100, _POLICY)(costs[: k + 1]) for k in range(1, 16))


@pytest.mark.parametrize("kept", (1e-1, 1e-3))
def test_a_fit_that_cannot_beat_another_in_time_is_given_up(kept):
    """From half of the attempts on, if each further one would have to gain a factor of
    more than ten; a fit that gains more is not stopped.
    """
    costs = [1e12 * kept**k for k in range(10)]
    stop = given_up(100, _POLICY, beaten=100.0)
    stopped = [stop(costs[: k + 1]) for k in range(10)]
    assert stopped == [False] * 4 + ([True] * 6 if kept > 1e-2 else [False] * 6)


@pytest.mark.usefixtures("unchecked_types")
def test_a_fit_that_goes_on_to_an_optimum_at_the_same_cost_is_kept(monkeypatch):
    ends = iter([(False, 15), (True, 3)])

    def fit(problem, free, start, iterations, stop):
        converged, count = next(ends)
        return SimpleNamespace(
            cost=500.0, optimal=converged, iterations=count, point=start
        )

    monkeypatch.setattr(_trials, "fit", fit)
    nominal = Point(np.zeros((1, 0)), np.zeros((1, 1, 2)))  # pyright: ignore
    problem = SimpleNamespace(samples=100, start=nominal, names=())
    trials = _trials.Trials(problem, (), (), _POLICY, print)  # pyright: ignore
    first = trials.attempt(frozenset(), None)
    assert first is not None and first.cut and not trials.settled(first)
    last = trials.finished(first)
    assert last.fit.optimal and trials.settled(last)
    assert trials.known[frozenset()] is last
