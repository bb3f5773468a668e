"""`console doctor` and `console controller` over real links to a simulator that is a process of its own."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from profiles.store import list_machines
from tests.preloaded import completed
from tests.signed_profile import signed_copy

if TYPE_CHECKING:
    from tests.system.conftest import Serve, Served

pytestmark = pytest.mark.system

TIMEOUT_S = 50

every_machine = pytest.mark.parametrize("machine", [entry.name for entry in list_machines()])


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return completed(words, TIMEOUT_S)


def addresses(served: Served) -> list[str]:
    hosts = {"tcp": served.tcp, "ethernet": served.ethernet}
    return [f"serial:{served.device}", *(f"{kind}:{host}:{port}" for kind, (host, port) in hosts.items())]


@every_machine
def test_a_fresh_simulator_of_a_bundled_machine_is_green(machine: str) -> None:
    done = run("doctor", "--machine", machine, "--link", "sim:", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    said = json.loads(done.stdout)
    assert said["simulated"] is True
    assert {check["outcome"] for check in said["checks"]} == {"holds", "noted"}


@pytest.mark.long
def test_every_link_leads_to_the_same_verdict(serve: Serve, tmp_path: Path) -> None:
    listeners = ("--tcp", "127.0.0.1:0", "--ethernet", "127.0.0.1:0", "--pty")
    machine = str(signed_copy("turbo-ethernet-lathe", tmp_path))
    with serve(*listeners, "--machine", machine) as served:
        found, lines = [], []
        for address in addresses(served):
            done = run("doctor", "--machine", machine, "--link", address, "--json")
            assert (done.returncode, done.stderr) == (0, ""), address
            said = json.loads(done.stdout)
            assert (said["simulated"], said["address"]) == (False, address)
            lines += [check["code"] for check in said["checks"] if check["code"].endswith("_checksums")]
            found.append([check for check in said["checks"] if check["code"] not in lines])
        # The serial line, and what may lie behind a terminal server, are checked by nothing but the controller.
        assert lines == ["line_checksums", "line_checksums", "network_checksums"]
        assert found[0] == found[1] == found[2]
        done = run("doctor", "--machine", machine, "--link", f"{address}?stop=reserved", "--json")
        assert (done.returncode, done.stderr) == (0, "")
        said = json.loads(done.stdout)
        (own,) = [check for check in said["checks"] if check not in found[2] and check["code"] not in lines]
        assert (said["address"], own["code"]) == (f"{address}?stop=reserved", "stop_connection")
        backup = str(tmp_path / "card.pmac")
        assert (
            run("controller", "backup", backup, "--machine", machine, "--link", addresses(served)[2]).returncode
            == 0
        )
        assert (
            run("controller", "diff", backup, "--machine", machine, "--link", addresses(served)[1]).returncode == 0
        )


def test_a_profile_that_is_signed_for_the_simulator_is_red_on_a_real_link(serve: Serve) -> None:
    with serve("--pty") as served:
        done = run("doctor", "--link", f"serial:{served.device}", "--json")
    failed = [check["code"] for check in json.loads(done.stdout)["checks"] if check["outcome"] == "fails"]
    assert (done.returncode, failed) == (1, ["signed_for_simulator"])


def test_nobody_there_is_one_line() -> None:
    done = run("doctor", "--link", "serial:/dev/there-is-none")
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (1, "", 1)
