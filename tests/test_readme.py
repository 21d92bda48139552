"""What README.md says is run, not believed."""

import re
import stat
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def _block(language: str) -> str:
    found = re.search(rf"^```{language}\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
    assert found is not None
    return found[1]


def test_example_prints_what_is_shown(capsys):
    exec(compile(_block("python"), "README.md", "exec"), {"__name__": "readme"})
    assert capsys.readouterr().out == _block("text")


def test_continuous_integration_runs_the_test_command_of_the_readme():
    setup = re.findall(r"^python3 -m venv .*$", README, re.MULTILINE)
    assert len(setup) == 2
    command = setup[1].rpartition(" && ")[2]
    assert command == 'python -m pytest -n 2 -m "not slow"'
    script = ROOT / ".ci" / "run"
    assert command in script.read_text(encoding="utf-8").splitlines()
    assert script.stat().st_mode & stat.S_IXUSR


@pytest.mark.parametrize(
    "name", ["simulate", "demo", "continue", "fit", "diagnose", "reproduce"]
)
def test_commands_of_the_readme_exist(name, monkeypatch, capsys):
    from jaxcam.cli import main

    assert f"`jaxcam {name}`" in README
    monkeypatch.setattr("sys.argv", ["jaxcam", name, "--help"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code in (0, None)
    assert "--out" in capsys.readouterr().out
