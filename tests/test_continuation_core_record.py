"""Branches on disk and on the screen; many branches at once."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
import rich.console
from continuation_examples import a, b, CUSP, cusp_start, LOGISTIC, mu

import continuation
from continuation import BranchSettings, PolynomialPredictor, PseudoArclength


def _same(one, other):
    assert len(one.points) == len(other.points)
    for p, q in zip(one.points, other.points, strict=True):
        assert (p.label, p.kind, p.parameter) == (q.label, q.kind, q.parameter)
        assert np.array_equal(p.state, q.state)
        assert np.array_equal(p.tangent, q.tangent)
        assert np.array_equal(p.multipliers, q.multipliers)
        assert (p.step, p.reason, p.coefficient) == (q.step, q.reason, q.coefficient)


@pytest.fixture(scope="module")
def whole():
    return continuation.branch(
        CUSP,
        cusp_start(-1.0),
        a,
        (-3.0, 3.0),
        PseudoArclength(PolynomialPredictor(4)),
        direction=-1,
    )


def test_a_saved_branch_reads_back_identical(whole, tmp_path):
    path = tmp_path / "cusp.jsonl"
    continuation.save_branch(whole, path)
    again = continuation.load_branch(path, CUSP)
    _same(whole, again)
    assert (again.name, again.bounds) == ("a", (-3.0, 3.0))
    # points carry the problem, so that they can be followed further
    curve = continuation.curve(
        again.of_kind("fold")[0], (a, b), ((-3.0, 3.0), (-2.0, -0.5))
    )
    assert curve.points[-1].parameters[1] in (-2.0, -0.5)


def test_restart_from_any_label_gives_the_identical_branch(whole, tmp_path):
    path = tmp_path / "cusp.jsonl"
    continuation.save_branch(whole, path)
    saved = continuation.load_branch(path, CUSP)
    middle = [p for p in saved.points if p.kind == "regular"][len(saved.points) // 2]
    rest = list(
        continuation.follow(
            CUSP,
            saved.at(middle.label),
            a,
            (-3.0, 3.0),
            PseudoArclength(PolynomialPredictor(4)),
            history=saved.points,
        )
    )
    expected = whole.points[middle.label :]
    assert [p.parameter for p in rest] == [p.parameter for p in expected]
    assert [p.kind for p in rest] == [p.kind for p in expected]
    assert np.array_equal([p.state for p in rest], [p.state for p in expected])


@pytest.mark.parametrize("share", [0.1, 0.45, 0.8])
def test_an_interrupted_run_is_resumed(whole, tmp_path, share):
    path = tmp_path / "run.jsonl"
    arguments = (
        CUSP,
        cusp_start(-1.0),
        a,
        (-3.0, 3.0),
        PseudoArclength(PolynomialPredictor(4)),
    )
    continuation.branch(*arguments, direction=-1, out=path)
    text = path.read_text("utf-8")
    # killed in the middle of a line
    path.write_text(text[: int(share * len(text))], "utf-8")
    kept = len(continuation.load_branch(path).points)
    new = []
    resumed = continuation.branch(
        *arguments, direction=-1, out=path, resume=True, callbacks=[new.append]
    )
    _same(whole, resumed)
    assert path.read_text("utf-8") == text
    # at most the special points behind the last ordinary one are computed twice
    assert len(whole.points) - kept <= len(new) <= len(whole.points) - kept + 2
    # a run that is complete is only read
    new.clear()
    again = continuation.branch(
        *arguments, direction=-1, out=path, resume=True, callbacks=[new.append]
    )
    _same(whole, again)
    assert not new


def test_an_interrupted_curve_is_resumed(whole, tmp_path):
    path = tmp_path / "curve.jsonl"
    arguments = (whole.of_kind("fold")[0], (a, b), ((-3.0, 3.0), (-2.0, 2.0)))
    curve = continuation.curve(*arguments, out=path, direction=1)
    text = path.read_text("utf-8")
    path.write_text(text[: len(text) // 2], "utf-8")
    _same(curve, continuation.curve(*arguments, out=path, direction=1, resume=True))
    assert path.read_text("utf-8") == text


def test_resuming_something_else_is_refused(tmp_path):
    path = tmp_path / "run.jsonl"
    continuation.branch(LOGISTIC, [0.5], mu, (1.5, 4.0), out=path)
    with pytest.raises(ValueError, match="bounds"):
        continuation.branch(LOGISTIC, [0.5], mu, (1.5, 3.9), out=path, resume=True)


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "x.jsonl"
    for text, words in (
        ("hello\n", "not JSON"),
        ('{"format": "x"}\n', "not a saved branch"),
        ('{"format": "continuation branch", "version": 2}\n', "version 2"),
    ):
        path.write_text(text, "utf-8")
        with pytest.raises(ValueError, match=words):
            continuation.load_branch(path)


def test_the_file_is_plain_json(tmp_path):
    path = tmp_path / "run.jsonl"
    continuation.branch(LOGISTIC, [0.5], mu, (1.5, 4.0), out=path)

    def refuse(word):
        raise AssertionError(word)

    lines = [
        json.loads(line, parse_constant=refuse)
        for line in path.read_text("utf-8").splitlines()
    ]
    assert lines[0]["version"] == 1
    assert [line["label"] for line in lines[1:]] == list(range(1, len(lines)))


def test_table_and_progress(whole):
    console = rich.console.Console(record=True, width=100, file=open("/dev/null", "w"))
    console.print(continuation.table(whole, every=10))
    text = console.export_text()
    assert text.count("fold") == 2 and text.count("end") == 1
    assert "-0.384900179" in text
    console.print(continuation.table(whole, shown=("a thousandth", 1e3)))
    text = console.export_text()
    assert "a thousandth" in text and "-384.900179" in text
    show = continuation.PointPrinter(console=console)
    for point in whole.points:
        show(point)
    assert console.export_text().count("fold") == 2
    console.file.close()


def test_batch_agrees_with_single_branches():
    values = np.linspace(-2.0, -0.5, 20)
    starts = [cusp_start(value) for value in values]
    batch = continuation.follow_batch(
        CUSP,
        starts,
        a,
        (-3.0, 3.0),
        parameters={"a": 2.0, "b": values},
        direction=-1,
        points=200,
    )
    assert set(batch.reasons) == {"the parameter is at its bound"}
    for i, value in enumerate(values):
        n = batch.count[i]
        x, p = batch.states[i, :n, 0], batch.parameters[i, :n]
        assert np.max(np.abs(p + value * x + x**3)) < 1e-9
        assert p[0] == 2.0 and p[-1] == -3.0
        slope = batch.multipliers[i, :n, 0].real
        assert slope == pytest.approx(value + 3 * x**2, abs=1e-9)
    lane = batch.lane(7)
    # a special point has its own multiplier and tangent: both vanish at a fold
    for point in lane.of_kind("fold"):
        assert abs(point.multipliers[0]) < 1e-9
        assert abs(point.tangent[-1]) < 1e-9
        assert point.criticality and point.arclength > 0
    assert np.all(np.diff([point.arclength for point in lane.points]) > 0)
    fold = 2 * (-values[7] / 3) ** 1.5
    found = [point.parameter for point in lane.of_kind("fold")]
    assert found == pytest.approx([-fold, fold], abs=1e-10)
    single = continuation.branch(
        continuation.Equilibrium(CUSP.vector_field, {"a": 2.0, "b": values[7]}),
        starts[7],
        a,
        (-3.0, 3.0),
        settings=BranchSettings(special=False),
        direction=-1,
    )
    assert lane.regular[-1].state == pytest.approx(single.points[-1].state, abs=1e-9)
    assert len(lane.regular) == len(single.points)


def saddle_field(u, p):
    """A saddle for |mu| < 1, with eigenvalues mu + 1 and mu - 1, in an uncoupled
    equation.
    """
    return jnp.stack([(p["mu"] + 1.0) * u[0], (p["mu"] - 1.0) * u[1]])


def test_a_batch_reports_no_hopf_point_at_a_neutral_saddle():
    problem = continuation.Equilibrium(saddle_field, {"mu": -0.5})
    batch = continuation.follow_batch(problem, [[0.0, 0.0]], mu, (-0.6, 0.5), points=40)
    # the eigenvalues at mu = 0 are 1 and -1: their sum changes sign
    sums = np.sum(batch.multipliers[0, : batch.count[0]].real, axis=-1)
    assert sums[0] < 0 < sums[-1]
    assert batch.lane(0).special == ()


def test_a_lane_that_cannot_start_spoils_nothing():
    batch = continuation.follow_batch(
        CUSP, [[np.nan], cusp_start(-1.0)], a, (-3.0, 3.0), direction=-1, points=5
    )
    assert batch.count.tolist() == [0, 5]
    assert "not a solution" in batch.reasons[0]
    assert "requested number" in batch.reasons[1]
    with pytest.raises(ValueError, match="branch 0 has no points"):
        batch.lane(0)
    with pytest.raises(ValueError, match="3 values for 2 branches"):
        continuation.follow_batch(
            CUSP, [[0.0], [0.0]], a, (-3.0, 3.0),
            parameters={"a": 2.0, "b": np.ones(3)},
        )  # fmt: skip
