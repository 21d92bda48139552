"""Missing physics at other coordinates and gaps than the first."""

import dataclasses
from types import SimpleNamespace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from test_discrepancy_coordinates import Pair, PAIRS, Push, Softer

from jaxcam import HybridSystem
from jaxcam.discrepancy import diagnose, library, Policy, Verdict
from jaxcam.discrepancy._elsewhere import (
    falls_short,
    law_elsewhere,
    sought_elsewhere,
)
from jaxcam.discrepancy.report import Diagnosis
from jaxcam.discrepancy.search import _slots
from jaxcam.discrepancy.search._roughness import Roughness
from jaxcam.discrepancy.search._slots import filled, roomy, slots_of
from jaxcam.discrepancy.terms import (
    EVERY,
    Family,
    gaps_of,
    Location,
    other_locations,
    Variable,
    Where,
    WithTerms,
)
from jaxcam.fitting import Model, Parameter, Problem, Sensor
from jaxcam.recordings import Recording, segment


SENSORS = {"one_m": Sensor(0, noise=1e-5), "two_m": Sensor(2, noise=1e-5)}


def _problem(system, sensors, states: int):
    """What a location needs of a problem."""
    pairs = PAIRS if states > 3 else PAIRS[:1]
    model = SimpleNamespace(system=WithTerms(system, (), pairs), sensors=sensors)
    start = SimpleNamespace(states=np.zeros((1, 2, states)))
    return SimpleNamespace(model=model, start=start)


class Warm(HybridSystem):
    """A mass that falls onto a floor and has a temperature, the last of its states."""

    def vector_field(self, t, state):
        x, v, warmth = state
        return jnp.stack([v, -9.81 - 0.1 * v, v * v - warmth])

    def gap(self, t, state):
        x, v, warmth = state
        return x

    def impact(self, t, state):
        x, v, warmth = state
        return jnp.stack([x, -0.5 * v, warmth])


class Free(Warm):
    """The same without a floor."""

    def gap(self, t, state):
        return jnp.zeros((0,))

    def impact(self, t, state):
        return jnp.zeros((0, 3))


def test_the_other_locations_are_measured_coordinates_and_gaps(unchecked_types):
    """Two masses, a wall and their contact; a velocity is no position."""
    both = other_locations(_problem(Pair(), SENSORS, 4))  # pyright: ignore
    assert both == [Location(1, 0), Location(0, 1), Location(0, EVERY)]
    one = {"one_m": SENSORS["one_m"], "rate_m_s": Sensor(3, noise=1e-3)}
    only = other_locations(_problem(Pair(), one, 4))  # pyright: ignore
    assert only == [Location(0, 1), Location(0, EVERY)]


def test_a_gap_is_evaluated_at_the_whole_state(unchecked_types):
    """Also where the last component is no coordinate; a system may have no gap."""
    sensors = {"one_m": SENSORS["one_m"]}
    for system, gaps in ((Warm(), 1), (Free(), 0)):
        problem = _problem(system, sensors, 3)
        assert gaps_of(problem) == gaps  # pyright: ignore
        assert other_locations(problem) == []  # pyright: ignore


def test_a_coordinate_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="acts on coordinate 2, but the system has 2"):
        Location().reordered(Push(0.5, coordinate=2), 2)
    assert Location().reordered(Push(0.5, coordinate=-1), 2).coordinate == 1


def test_a_location_has_its_coordinate_first_and_own_terms_keep_theirs():
    """A term of one's own acts on the same coordinate and gap in any order."""
    state, time = jnp.array([0.2, 1.5, 0.9, -0.5]), jnp.asarray(0.3)
    at = Location(coordinate=1)
    pairs = at.first(PAIRS)
    assert pairs == (PAIRS[1], PAIRS[0])
    for place in (0, 1):
        push = Push(0.5, coordinate=place)
        usual = WithTerms(Pair(), (push,), PAIRS)
        other = WithTerms(Pair(), (at.reordered(push, 2),), pairs)
        np.testing.assert_array_equal(
            usual.vector_field(time, state), other.vector_field(time, state)
        )


def test_library_terms_act_at_the_gap_of_a_location():
    """The restitution between the masses falls, that of the wall does not."""
    at = Location(constraint=1)
    assert all(at.of_library(term).constraint == 1 for term in library())
    softer = at.of_library(Softer(0.5))
    state = jnp.array([0.2, 1.5, 0.2, -0.5])
    system = WithTerms(Pair(), (softer,), PAIRS)
    wall, joint = system.impact(0.3, state)
    np.testing.assert_array_equal(wall, Pair().impact(0.3, state)[0])
    assert float(joint[3] - joint[1]) == pytest.approx(0.6 * 0.5 * 2.0, rel=1e-12)


def test_a_law_at_every_gap_acts_at_all_of_them():
    """Both impacts are softer; errors of surfaces remain at the first gap."""
    every = Location(constraint=EVERY)
    places = {term.constraint for term in map(every.of_library, library())}
    assert places == {0, EVERY}
    softer, state = every.of_library(Softer(0.5)), jnp.array([0.2, 1.5, 0.2, -0.5])
    found = WithTerms(Pair(), (softer,), PAIRS).impact(0.3, state)
    for gap in (0, 1):
        alone = Location(constraint=gap).of_library(Softer(0.5))
        one = WithTerms(Pair(), (alone,), PAIRS).impact(0.3, state)
        np.testing.assert_array_equal(found[gap], one[gap])
        assert not np.allclose(found[gap], Pair().impact(0.3, state)[gap])


def test_each_gap_has_a_slot_of_its_own():
    """A function at one gap changes the impacts there only."""
    time = 1e-3 * np.arange(400)
    noise = 1e-5 * np.random.default_rng(1).standard_normal((2, len(time)))
    seen = {"one_m": 0.2 + 1.5 * time + noise[0], "two_m": 3.0 - 0.5 * time + noise[1]}
    run = segment(Recording("run", time, seen), "one_m", noise=1e-5)
    model = Model(WithTerms(Pair(), (), PAIRS), SENSORS)
    problem = Problem.build(model, [run], [])
    family = Family(Where.IMPACT, Variable.APPROACH, 0.0, 4.0)
    room = roomy(problem, family, (0, 1), None)
    state = jnp.array([0.2, 1.5, 0.2, -0.5])
    before = room.model.system.impact(0.3, state)
    for gap in (0, 1):
        (slot,) = slots_of(room, Where.IMPACT, gap)
        there = dataclasses.replace(family, constraint=gap)
        put = filled(room, [_slots.Free(there, Roughness(), slot)])
        place = [t.label for t in put.model.system.terms].index(slot)
        term = put.model.system.terms[place]
        numbers = tuple(jnp.asarray(0.3) for _ in term.coefficients)
        moved = eqx.tree_at(lambda t: t.coefficients, term, numbers)
        system = eqx.tree_at(lambda s: s.terms[place], put.model.system, moved)
        after = system.impact(0.3, state)
        assert not np.allclose(after[gap], before[gap])
        np.testing.assert_array_equal(after[1 - gap], before[1 - gap])


@dataclasses.dataclass(frozen=True)
class _Found:
    """What the choice of a location needs of a diagnosis."""

    cost: float
    verdict: Verdict = Verdict.UNKNOWN
    policy: Policy = Policy()
    summary: str = "An effect is missing."
    location: tuple[str, str] | None = None
    differing: None = None
    noise_floor: float = 1e-4
    bare: float = 1e6
    missing: tuple = ()
    effects: tuple = ()

    @property
    def before(self):
        return SimpleNamespace(cost=self.bare)

    @property
    def after(self):
        problem = _problem(Pair(), SENSORS, 4)
        problem.samples = 1000
        return SimpleNamespace(cost=self.cost, problem=problem)


@pytest.mark.parametrize(
    ("costs", "chosen", "asked"),
    [
        # the second coordinate explains everything: the gap is not tried
        ((1000.0, 1000.0), ("x2", "constraint 0"), 1),
        ((4000.0, 1500.0), ("x1", "constraint 1"), 3),
        # the same law at both gaps
        ((4000.0, 1500.0, 1000.0), ("x1", "every gap"), 3),
        # a little less than the first: not worth another place
        ((4000.0, 4500.0), None, 3),
    ],
)
def test_the_location_that_explains_clearly_more_is_chosen(
    costs, chosen, asked, unchecked_types
):
    given = {Location(0, EVERY): 5000.0}
    given |= zip((Location(1, 0), Location(0, 1), Location(0, EVERY)), costs)
    tried = []

    def ask(location):
        tried.append(location)
        return _Found(given[location])

    found = sought_elsewhere(_Found(5000.0), ask)  # pyright: ignore
    assert found.location == chosen
    assert len(tried) == asked
    assert ("This effect acts at" in found.summary) == (chosen is not None)


def test_a_named_effect_that_explains_nearly_everything_does_not_fall_short(
    unchecked_types,
):
    """What is left, 4000 of 1e6, may be an error of the form of the named term."""
    named = _Found(5000.0, Verdict.EFFECT)
    assert not falls_short(named)  # pyright: ignore
    assert falls_short(dataclasses.replace(named, bare=1e5))  # pyright: ignore
    assert falls_short(_Found(5000.0))  # pyright: ignore


def test_a_function_at_the_first_gap_is_not_said_to_act_at_another(unchecked_types):
    """It was found by the search at the second gap, which offers functions at both."""
    law = (SimpleNamespace(gap="constraint 0", kind="surface", arguments=("time",)),)

    def ask(location):
        cost = 1000.0 if location == Location(0, 1) else 5000.0
        return _Found(cost, missing=law, effects=(SimpleNamespace(term=False),))

    found = sought_elsewhere(_Found(5000.0), ask)  # pyright: ignore
    assert (found.cost, found.location) == (1000.0, None)
    assert "acts at" not in found.summary


def test_a_law_at_another_gap_is_named_there(unchecked_types):
    """The unnamed law leaves as little as the named one; its gap is tried first."""
    law = SimpleNamespace(gap="constraint 1", kind="restitution", arguments=("speed",))
    unnamed = _Found(1010.0, missing=(law,))
    assert law_elsewhere(unnamed)  # pyright: ignore
    law_at_first = SimpleNamespace(**vars(law) | {"gap": "constraint 0"})
    assert not law_elsewhere(_Found(1010.0, missing=(law_at_first,)))  # pyright: ignore
    tried = []

    def ask(location):
        tried.append(location)
        effects = (SimpleNamespace(term=True),)
        return _Found(1005.0, Verdict.EFFECT, effects=effects)

    found = sought_elsewhere(unnamed, ask)  # pyright: ignore
    assert tried == [Location(0, 1)]
    assert found.verdict is Verdict.EFFECT
    assert found.location == ("x1", "constraint 1")


def test_laws_at_several_gaps_are_named_at_all_gaps(unchecked_types):
    """Both unnamed laws together leave only noise; one location is tried."""
    laws = tuple(
        SimpleNamespace(gap=f"constraint {k}", kind="restitution", arguments=("speed",))
        for k in (0, 1)
    )
    tried = []

    def ask(location):
        tried.append(location)
        effects = (SimpleNamespace(term=True),)
        return _Found(1005.0, Verdict.EFFECT, effects=effects)

    unnamed = _Found(1010.0, missing=laws)
    assert law_elsewhere(unnamed)  # pyright: ignore
    found = sought_elsewhere(unnamed, ask)  # pyright: ignore
    assert tried == [Location(0, EVERY)]
    assert found.location == ("x1", "every gap")


def test_a_law_at_the_only_gap_is_not_elsewhere(unchecked_types):
    """With one gap, functions do not name it."""
    law = SimpleNamespace(gap="", kind="restitution", arguments=("speed",))
    assert not law_elsewhere(_Found(1010.0, missing=(law,)))  # pyright: ignore


def test_terms_of_ones_own_are_not_moved_to_other_gaps(unchecked_types):
    """They have a gap of their own: only the other coordinate is tried."""
    tried = []

    def ask(location):
        tried.append(location)
        return _Found(4900.0)

    found = sought_elsewhere(_Found(5000.0), ask, library=False)  # pyright: ignore
    assert tried == [Location(1, 0)]
    assert found.location is None


class Two(HybridSystem):
    """Two oscillators, coupled by a weak spring, far from any stop."""

    state_names = ("left", "left_rate", "right", "right_rate")
    stiffness: float = 150.0
    coupling: float = 20.0
    damping: float = 0.1

    def vector_field(self, t, state):
        x, v, y, w = state
        pull = self.coupling * (x - y)
        return jnp.stack(
            [
                v,
                -self.stiffness * x - self.damping * v - pull,
                w,
                -self.stiffness * y - self.damping * w + pull,
            ]
        )

    def gap(self, t, state):
        return state[0] + 100.0

    def impact(self, t, state):
        return state * jnp.array([1.0, -0.5, 1.0, 1.0])


def _recorded(start, seed: int) -> Recording:
    """The two oscillators, the second with dry friction, by the method of Heun."""
    rng, h = np.random.default_rng(seed), 2e-5
    state, rows = np.array(start), []

    def field(s):
        x, v, y, w = s
        pull = 20.0 * (x - y)
        rub = 0.4 * np.tanh(w / 1e-3)
        return np.array(
            [v, -150 * x - 0.1 * v - pull, w, -150 * y - 0.1 * w + pull - rub]
        )

    for k in range(125_000):
        if k % 50 == 0:
            rows.append(state[[0, 2]])
        slope = field(state)
        state = state + h / 2 * (slope + field(state + h * slope))
    seen = np.array(rows) + 1e-5 * rng.standard_normal((len(rows), 2))
    time = 1e-3 * np.arange(len(rows))
    return Recording(f"run{seed}", time, {"one_m": seen[:, 0], "two_m": seen[:, 1]})


@pytest.mark.slow
def test_friction_on_the_second_coordinate_is_found_there():
    """Its force to 2 %, and the sentence says where it was sought."""
    runs = [
        segment(_recorded(start, k), "one_m", noise=1e-5)
        for k, start in enumerate(([0.2, 0, 0.15, 0], [0.1, 0, -0.2, 0]))
    ]
    parameters = [
        Parameter("stiffness", lambda m: m.system.stiffness, 3.0, unit="1/s^2"),
        Parameter("coupling", lambda m: m.system.coupling, 1.0, unit="1/s^2"),
        Parameter("damping", lambda m: m.system.damping, 0.05, unit="1/s"),
    ]
    found: Diagnosis = diagnose(Two(), runs, sensors=SENSORS, parameters=parameters)
    assert found.location == ("right", "constraint 0")
    assert found.names == ("coulomb_friction",)
    (strength,) = found.effects[0].parameters.values()
    assert strength.value == pytest.approx(0.4, rel=0.02)
    assert "sought at the coordinate right" in found.summary
