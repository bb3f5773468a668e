"""The manual page is that of the commands, and man reads it; shells read their completion."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from console.cli.commands import COMMANDS
from console.cli.site.completion import NAMES, SHELLS, completion_of
from docs.manual_page import PAGE, manual_page

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="argparse of another Python breaks lines otherwise")
def test_the_manual_page_is_that_of_the_commands() -> None:
    if os.environ.get("GOLDENS") == "write":
        PAGE.write_text(manual_page(), encoding="utf-8")
    assert PAGE.read_text(encoding="utf-8") == manual_page(), "write it anew: python -m docs.manual_page"


def test_the_manual_page_has_every_command_and_is_in_the_wheel() -> None:
    text = PAGE.read_text(encoding="utf-8").replace("\\-", "-")
    assert [name for name in COMMANDS if f"console {name}" not in text] == []
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    shared = project["tool"]["hatch"]["build"]["targets"]["wheel"]["shared-data"]
    assert {source: shared[source] for source in shared if source.startswith("docs/man/")} == {
        f"docs/man/{name}.1": f"share/man/man1/{name}.1" for name in NAMES
    }


@pytest.mark.skipif(shutil.which("man") is None, reason="man is not installed (Debian and Ubuntu: man-db)")
def test_man_shows_it_without_a_warning() -> None:
    command = ["man", "--warnings", "--encoding=ascii", "-l", str(PAGE)]
    shown = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, "MANWIDTH": "80"}, check=True
    )
    assert shown.stderr == ""
    assert "--fail-out-of-tolerance" in shown.stdout and "EXIT STATUS" in shown.stdout


def completed(line: str, *, name: str = "console") -> list[str]:
    """What bash offers at the end of a line."""
    words = line.split(" ")
    quoted = " ".join(f"'{word}'" for word in words)
    asked = (
        f"COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; _shtab_{name}; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    )
    script = f"{completion_of('bash', name)}\n{asked}"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout.split()


def test_bash_completes_commands_actions_and_options() -> None:
    assert completed("console mt") == ["mtconnect"]
    assert completed("console records ex") == ["export"]
    assert completed("console run --fail") == ["--fail-out-of-tolerance"]
    assert completed("console run --strategy t") == ["timebase"]
    assert completed("trilobe wa", name="trilobe") == ["watch"]


@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_reads_its_completion(shell: str) -> None:
    script = completion_of(shell, "console")
    assert [name for name in COMMANDS if name not in script] == []
    program = shutil.which(shell)
    if program is None:
        pytest.skip(f"{shell} is not installed")
    subprocess.run([program, "-n"], input=script, text=True, check=True, capture_output=True)


def test_no_other_command_pays_for_completion() -> None:
    script = "import sys, console.__main__ as m; m.main(['jobs']); assert 'shtab' not in sys.modules"
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)
