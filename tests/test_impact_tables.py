"""Tables of impacts: what is read, which law is found, and what is refused."""

import dataclasses
import json

import equinox as eqx
import hostile_files
import jax
import numpy as np
import pytest
from typer.testing import CliRunner

from jaxcam.cli import app
from jaxcam.fitting import impact_law
from jaxcam.fitting._restitution import fit_rows
from jaxcam.recordings import ImpactTable, read_impacts, RecordingError
from jaxcam.recordings.files import is_impact_table


# what a user sees, whose types nothing checks
pytestmark = pytest.mark.usefixtures("unchecked_types")


def made(exponent, seed=0, count=24, noise=0.01, shared=False, **more):
    """Impacts of r = 0.8 (1 + v)^-b, each speed or each restitution with noise."""
    rng = np.random.default_rng(seed)
    v = rng.uniform(0.1, 2.0, count)
    size = noise * v if shared else noise
    after = 0.8 * (1 + v) ** -exponent * v + size * rng.standard_normal(count)
    return ImpactTable("made", v, np.abs(after), **more)


def written(tmp_path, text, name="impacts.csv"):
    file = tmp_path / name
    file.write_text(text)
    return file


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize(
    ("exponent", "best"), [(0.0, "constant"), (0.3, "falling"), (-0.2, "rising")]
)
def test_the_law_is_found_with_its_error(exponent, best, shared):
    table = made(exponent, shared=shared)
    found = impact_law(table)
    assert found.best == best
    for speed in (0.2, 1.0, 1.9):
        r = float(found.law.law(0.0, speed))  # pyright: ignore
        assert r == pytest.approx(0.8 * (1 + speed) ** -exponent, abs=0.02)
    assert found.scatter_unit == ("1" if shared else "m/s")
    assert found.scatter == pytest.approx(0.01, rel=0.5)
    assert (found.p_value < 0.01) == (best != "constant")
    assert found.delta_bic["constant"] == 0 and len(found.delta_bic) == 3
    word = {"constant": "is constant", "falling": "falls", "rising": "rises"}[best]
    assert word in found.sentences()[0]


def test_errors_are_those_that_repetition_shows():
    """Of 60 tables with a constant restitution, and no dependence on speed named."""
    found = [impact_law(made(0.0, seed)) for seed in range(60)]
    off = [
        (one.laws["constant"].values[0] - 0.8) / one.laws["constant"].stderr[0]
        for one in found
    ]
    assert 0.75 < np.std(off) < 1.3 and abs(np.mean(off)) < 0.4
    assert sum(one.best != "constant" for one in found) <= 3


def test_a_misread_row_is_named_and_changes_nothing():
    table = made(0.3)
    wrong = table.separation.copy()
    wrong[7] *= 10
    found = impact_law(dataclasses.replace(table, separation=wrong))
    assert found.set_aside == (8,) and found.best == "falling"
    assert any("row 8; check the table" in one for one in found.sentences())
    without = impact_law(table).law.values
    np.testing.assert_allclose(found.law.values, without, rtol=0.03)


def test_impacts_without_scatter_are_a_law_without_error():
    v = np.linspace(0.2, 2.0, 12)
    found = impact_law(ImpactTable("exact", v, 0.7 * v))
    assert found.best == "constant" and not found.set_aside
    assert found.law.values[0] == pytest.approx(0.7, abs=1e-9)


def test_stated_errors_weigh_the_impacts():
    """Half of the impacts are a hundred times as sure as the others."""
    rng = np.random.default_rng(1)
    v = rng.uniform(0.5, 2.0, 40)
    error = np.where(np.arange(40) % 2, 0.1, 0.001)
    after = 0.6 * v + error * rng.standard_normal(40)
    found = impact_law(ImpactTable("stated", v, after, separation_stderr=error))
    assert found.scatter_unit == "stated" and 0.6 < found.scatter < 1.4
    assert found.laws["constant"].values[0] == pytest.approx(0.6, abs=1e-3)


def test_columns_of_one_body(tmp_path):
    text = "ball;before_cm_s;after_cm_s;before_stderr_cm_s\na;-100;80;1\nb;-50,5;40;1\n"
    table = read_impacts(written(tmp_path, text))
    np.testing.assert_allclose(table.approach, [1.0, 0.505])
    np.testing.assert_allclose(table.separation, [0.8, 0.4])
    np.testing.assert_allclose(table.approach_stderr, 0.01)
    assert table.unit == "m/s" and table.bodies is None and table.name == "impacts"
    text = "v1,v2\n1,0.8\n2,1.6\n"
    named = read_impacts(
        written(tmp_path, text), columns={"v1": "before_rad_s", "v2": "after_rad_s"}
    )
    assert named.unit == "rad/s"
    np.testing.assert_allclose(named.separation, [0.8, 1.6])


def two_bodies(tmp_path, masses="0.2,0.3", kept=1.0):
    """Impacts of restitution 0.9 of a body of 0.2 kg with one of 0.3 kg."""
    rng, rows = np.random.default_rng(0), []
    for speed in np.linspace(0.2, 1.0, 8):
        part = 0.9 * speed
        first, second = (
            (0.2 * speed - 0.3 * part) / 0.5,
            (0.2 * speed + 0.2 * part) / 0.5,
        )
        noise = 1e-3 * rng.standard_normal(2)
        speeds = speed, first + noise[0], 0.0, kept * second + noise[1]
        rows.append(",".join(f"{x:.5f}" for x in speeds) + f",{masses}")
    head = "before1_m_s,after1_m_s,before2_m_s,after2_m_s,mass1_kg,mass2_kg"
    return read_impacts(written(tmp_path, "\n".join([head, *rows, ""])))


def test_momentum_of_two_bodies(tmp_path):
    balance = impact_law(two_bodies(tmp_path)).momentum
    assert balance.kept and abs(balance.change) < 0.01
    assert balance.ratio == pytest.approx(1.5, abs=4 * balance.ratio_stderr)
    assert "Momentum is conserved" in balance.sentence()
    # one speed is read on a wrong scale
    balance = impact_law(two_bodies(tmp_path, kept=0.9)).momentum
    assert not balance.kept and balance.change == pytest.approx(-0.1, abs=0.01)
    assert "not conserved" in balance.sentence()
    # one mass is not what it is said to be
    balance = impact_law(two_bodies(tmp_path, masses="0.2,0.2")).momentum
    assert not balance.kept and balance.ratio == pytest.approx(1.5, abs=0.01)
    found = two_bodies(tmp_path)
    loose = dataclasses.replace(found.bodies, mass=None)
    balance = impact_law(dataclasses.replace(found, bodies=loose)).momentum
    assert "the second mass is 1.5" in balance.sentence()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("before_m_s,after_m_s\n0,0.5\n1,0.8\n", "in row 1 there is no approach"),
        ("before_m_s,after_m_s\n-1,-0.5\n1,-0.8\n", "in row 1 the bodies pass through"),
        ("before_m_s,after_rad_s\n1,0.5\n1,0.8\n", "one unit"),
        ("before_m_s,after_m_s\n1,x\n1,0.8\n", "`x` instead of a number"),
        ("before_m_s,other_m_s\n1,1\n1,0.8\n", "columns before_m_s and after_m_s"),
        (
            "before_m_s,after_m_s,after_stderr_m_s\n1,1,0\n1,1,1\n",
            "error in row 1 is 0",
        ),
        (
            "before1_m_s,after1_m_s,before2_m_s,after2_m_s,mass1_kg\n1,0,0,1,2\n"
            "1,0,0,1,2\n",
            "mass of only one body",
        ),
        (
            "before1_m_s,after1_m_s,before2_m_s,after2_m_s,mass1_kg,mass2_kg\n"
            "1,0,0,1,2,3\n1,0,0,1,2,-3\n",
            "mass in row 2 is not positive",
        ),
    ],
)
def test_a_table_that_cannot_be_used(tmp_path, text, said):
    with pytest.raises(RecordingError, match=said) as caught:
        read_impacts(written(tmp_path, text))
    hostile_files.said(caught.value)


def test_what_is_to_be_known_of_a_table():
    table = made(0.0, count=10)
    with pytest.raises(RecordingError, match="3 impacts; at least 4"):
        impact_law(ImpactTable("few", table.approach[:3], table.separation[:3]))
    swapped = ImpactTable("swapped", table.separation, table.approach)
    assert any("are interchanged" in one for one in impact_law(swapped).sentences())
    v = np.linspace(1.0, 1.1, 10)
    narrow = impact_law(ImpactTable("narrow", v, 0.7 * v + 0.01 * np.sin(9 * v)))
    assert any("1.10 times as fast as" in one for one in narrow.sentences())


class Saturating(eqx.Module):
    """A coefficient that reaches one only at infinity."""

    a: jax.Array

    def __call__(self, speed, approach_speed):
        del speed, approach_speed
        return self.a / (1 + self.a)


@pytest.mark.parametrize(("r", "converged"), [(0.7, True), (1.2, False)])
def test_a_law_that_did_not_converge_says_so(r, converged):
    """At an optimum, a step predicts a gain below 0.01; r = 1.2 has no optimum."""
    v, error = np.linspace(0.2, 2.0, 12), np.full(12, 0.01)
    data = np.stack([0 * v, v, r * v, 0 * v, error, 0 * v])
    law = fit_rows(data, Saturating(1.0), ("a",))  # pyright: ignore
    assert law.converged == converged
    assert ("did not converge" in law.sentence()) != converged
    found = impact_law(ImpactTable("exact", v, 0.7 * v))
    found = dataclasses.replace(found, laws={"constant": law})
    assert any("did not converge" in one for one in found.sentences()) != converged


def command(*words):
    found = CliRunner().invoke(app, list(map(str, words)))
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception
    return found


def test_the_command(tmp_path):
    table = made(0.3)
    rows = zip(table.approach, table.separation)
    text = "\n".join(["t;v1;v2", *(f"0;{a:.6f};{b:.6f}" for a, b in rows), ""])
    file = written(tmp_path, text.replace(".", ","))
    assert not is_impact_table(file)
    names = ["--columns", "-,before_m_s,after_m_s"]
    found = command("fit", file, *names, "--json", tmp_path / "law.json")
    assert found.exit_code == 0 and "Restitution falls" in found.stdout
    law = json.loads((tmp_path / "law.json").read_text())
    assert law["law"] == "falling" and law["delta_bic"]["falling"] < -10
    for words, said in (
        ([*names, "--out", str(tmp_path / "out")], "leave out --out"),
        (["--columns", "a=b,c"], "only pairs"),
        (["--columns", "v1=x*0"], "only pairs"),
        (["--rate", "0"], "--rate is 0"),
        ([], "no rig.toml"),
    ):
        found = command("fit", file, *words)
        assert found.exit_code == 2 and said in found.stderr
        assert len(found.stderr.splitlines()) == 1
