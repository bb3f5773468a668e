"""`console doctor` and `console controller` over real links to a simulator that is a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from profiles.store import load_machine

if TYPE_CHECKING:
    from tests.system.conftest import Serve, Served

pytestmark = pytest.mark.system

TIMEOUT_S = 50


def run(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "console", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, stdin=subprocess.DEVNULL)


def of_family(family: str, folder: Path) -> str:
    """Return a profile of the bundled machine with a controller of a family."""
    bundled = load_machine("lee-2001-lathe").path.read_text(encoding="utf-8")
    assert 'family = "pmac"' in bundled
    path = folder / f"{family}.toml"
    path.write_text(bundled.replace('family = "pmac"', f'family = "{family}"'), encoding="utf-8")
    return str(path)


def addresses(served: Served) -> list[str]:
    hosts = {"tcp": served.tcp, "ethernet": served.ethernet}
    return [f"serial:{served.device}", *(f"{kind}:{host}:{port}" for kind, (host, port) in hosts.items())]


@pytest.mark.parametrize("family", ["pmac", "turbo"])
def test_a_fresh_simulator_is_green(tmp_path: Path, family: str) -> None:
    done = run("doctor", "--machine", of_family(family, tmp_path), "--link", "sim:", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    said = json.loads(done.stdout)
    assert said["simulated"] is True
    assert {check["outcome"] for check in said["checks"]} == {"holds", "warned", "noted"}


@pytest.mark.parametrize("family", ["pmac", "turbo"])
def test_every_link_leads_to_the_same_verdict(serve: Serve, tmp_path: Path, family: str) -> None:
    machine = of_family(family, tmp_path)
    listeners = ("--tcp", "127.0.0.1:0", "--ethernet", "127.0.0.1:0", "--pty")
    with serve(*listeners, "--machine", machine) as served:
        found = []
        for address in addresses(served):
            done = run("doctor", "--machine", machine, "--link", address, "--json")
            assert (done.returncode, done.stderr) == (0, ""), address
            said = json.loads(done.stdout)
            assert (said["simulated"], said["address"]) == (False, address)
            found.append(said["checks"])
        assert found[0] == found[1] == found[2]
        backup = str(tmp_path / "card.pmac")
        assert (
            run("controller", "backup", backup, "--machine", machine, "--link", addresses(served)[2]).returncode
            == 0
        )
        assert (
            run("controller", "diff", backup, "--machine", machine, "--link", addresses(served)[1]).returncode == 0
        )


def test_nobody_there_is_one_line() -> None:
    done = run("doctor", "--link", "serial:/dev/there-is-none")
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (1, "", 1)
