"""Progress of commands whose standard error is not a terminal."""

import itertools

from jaxcam.cli import _progress


def test_lines_at_most_twice_a_minute(capsys, monkeypatch):
    """A report every ten seconds: one in three is written, with its fraction."""
    clock = itertools.count(0.0, 5.0)
    # each report looks at the clock once, and once more when it writes
    monkeypatch.setattr(_progress.time, "monotonic", lambda: next(clock))
    with _progress.progress("beginning") as report:
        for k in range(14):
            report(f"step {k}", k / 20 if k > 6 else None)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["step 5", "step 11 (55%)"]


def test_a_short_command_is_silent(capsys):
    with _progress.progress("beginning") as report:
        report("step", None)
    assert capsys.readouterr().err == ""
