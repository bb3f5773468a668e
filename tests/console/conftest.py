"""Fixtures for the console: a data folder of its own for each test, and signals put back after a run."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from console.__main__ import main
from profiles.lobe.lobe_conditions import CONDITIONS
from tests.branching import in_a_copy
from tests.compact import save_compact
from tests.console.commands import card as card
from tests.console.floor import Floor, set_up_once


@dataclass(frozen=True)
class Said:
    """What one command left behind."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@pytest.fixture
def data_folder(tmp_path: Path) -> Path:
    return tmp_path / "data"


@pytest.fixture
def console(
    data_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Callable[..., Said]]:
    """Call the command line in this process."""
    monkeypatch.setenv("XDG_DATA_HOME", str(data_folder))
    for name in ("LC_ALL", "LC_MESSAGES", "LANG"):
        monkeypatch.delenv(name, raising=False)
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}

    def call(*words: str) -> Said:
        capsys.readouterr()
        code = main(words)
        captured = capsys.readouterr()
        return Said(code=code, out=captured.out, err=captured.err)

    yield call
    for number, handler in kept.items():
        signal.signal(number, handler)


@pytest.fixture
def in_copies() -> None:
    """A test that takes this is carried out in a copy of its process: what it works, others find as it was."""


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    if "in_copies" not in pyfuncitem.fixturenames:
        return None
    given = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}
    in_a_copy(lambda: pyfuncitem.obj(**given))
    return True


def _is_number(text: str | None) -> bool:
    return text is not None and text.replace(".", "", 1).isdigit()


@pytest.fixture
def job_file(tmp_path: Path) -> Callable[..., Path]:
    """Write experiment 1 with some of its lines changed; None takes a line away.

    Its error was then found in a cut like that: speed, lengths and jaws of the calibration cut are changed with
    those of the job. Force and material are not.
    """

    def write(name: str = "mine", **changes: str | None) -> Path:
        import profiles.store

        text = (profiles.store.BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_text(encoding="utf-8")
        found = {
            key: own
            for key, own in CONDITIONS.items()
            if key not in ("lobe_force_n", "lobe_material") and _is_number(changes.get(own))
        }
        if not (changes.get("jaws") or "").isdigit() or not 2 <= int(changes["jaws"] or 0) <= 12:
            found.pop("lobe_jaws", None)
        changes = {**{key: changes[own] for key, own in found.items()}, **changes}
        lines = []
        for line in text.splitlines():
            key = line.partition(" = ")[0]
            if key in changes:
                value = changes[key]
                if value is None:
                    continue
                line = f"{key} = {value}"
            lines.append(line)
        path = tmp_path / f"{name}.toml"
        path.write_text("\n".join(lines), encoding="utf-8")
        return path

    return write


@pytest.fixture
def close(data_folder: Path) -> tuple[str, str]:
    """What has a part cut on the bundled lathe with everything close together: no test here is about its ways."""
    return save_compact(data_folder / "trilobe")


@pytest.fixture
def aligned(tmp_path: Path, in_copies: None) -> Floor:
    """A floor on which everything is set up, in a copy of this process."""
    return set_up_once(tmp_path)
