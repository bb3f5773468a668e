"""A cut whose state is published, and whose publishers are killed: the same part, to the bit."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from profiles.store import load_job, save_job
from tests.compact import save_compact
from tests.preloaded import Preloaded
from tests.system.site.test_mqtt import TOPIC, Subscriber, broker, free_port, needs_mosquitto, publishing, told
from tests.system.site.test_mtconnect import Agent, serving

pytestmark = [pytest.mark.system, pytest.mark.timeout(120), needs_mosquitto]

OF_THIS_RUN = ("run_id", "run", "record", "data")


def cut(data: Path, *more: str) -> subprocess.Popen[str]:
    """Start cuts with their plant drawn from a seed; one alone may be over before anybody looks for its feed."""
    job = data / "short.toml"
    save_job(replace(load_job("lee-2001-experiment-2").job, name="short", cut_length_mm=1.0), job)
    words = ["run", str(job), "--sim", "--json", "--plant", "realistic", "--seed", "3"]
    command = [
        sys.executable,
        "-m",
        "console",
        *words,
        "--strategy",
        "cam",
        "--learn",
        "2",
        "--data",
        str(data),
        *more,
    ]
    return Preloaded(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def result(process: subprocess.Popen[str]) -> dict[str, Any]:
    out, err = process.communicate(timeout=100.0)
    assert process.returncode == 0
    assert all(line.startswith("console: warning: the tool was off") for line in err.splitlines()), err
    found: dict[str, Any] = json.loads(out)
    return {key: value for key, value in found.items() if key not in OF_THIS_RUN}


@pytest.mark.long
def test_killing_those_who_publish_is_not_noticed_by_the_cut(tmp_path: Path) -> None:
    data, alone = tmp_path / "watched", tmp_path / "alone"
    machine, lone = save_compact(data), save_compact(alone)
    with ExitStack() as opened:
        port = free_port()
        opened.enter_context(broker(tmp_path, port))
        adapter, address = opened.enter_context(serving(data, "--sim", *machine))
        publisher = opened.enter_context(publishing(data, port, *machine))
        told(publisher, "connected")
        agent, stalled, reader = Agent(address), Agent(address, 4096), Subscriber(port)
        with cut(data, *machine) as process:
            agent.until("execution", "ACTIVE")
            reader.until(f"{TOPIC}avail", b"AVAILABLE")
            adapter.send_signal(signal.SIGKILL)
            publisher.send_signal(signal.SIGKILL)
            watched = result(process)
        for each in (agent, stalled, reader):
            each.close()
    with cut(alone, *lone) as process:
        assert result(process) == watched
