"""Waves beside the lobe and its overtones: learned where they are asked for, and only where they can be cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from console.session.errors import SessionError
from console.session.learning.learning_steps import Taught, taught
from drivers.cutting.planning import Strategy, plan_cut
from profiles.problem import Problem
from profiles.store import load_job, load_machine
from profiles.traces import Trace
from tests.console.commands import Console

JOB = load_job("lee-2001-experiment-1")
LATHE = load_machine("lee-2001-lathe")
ANGLE = np.arange(360.0)
OFF_UM = 2.0 * np.cos(5 * np.radians(ANGLE - 11.0)) + 1.5 * np.cos(2 * np.radians(ANGLE - 40.0))


def lesson(data: Path, strategy: str, extra: tuple[int, ...]) -> Taught:
    noise = np.random.default_rng(7).normal(0.0, 0.02, 360)
    meta = {
        "state": "free",
        "simulated": "yes",
        "direction": "spindle",
        "start_mark": "spindle index",
        "compensation": "none",
        "strategy": strategy,
        "stage": "full",
    }
    trace = Trace(angle_deg=ANGLE, deviation_um=OFF_UM + noise, meta=meta)
    date = "2001-11-30T14:05:00Z"
    return taught(trace, JOB, LATHE, data, {}, gain=None, robust=False, date=date, extra=extra)


def refused(data: Path, strategy: str, extra: tuple[int, ...]) -> list[Problem]:
    with pytest.raises(SessionError) as caught:
        lesson(data, strategy, extra)
    return list(caught.value.problems)


def test_waves_that_are_asked_for_are_learned_and_can_be_cut(tmp_path: Path) -> None:
    found = lesson(tmp_path, "cam", (2, 5)).step
    assert {2, 5} <= set(found.learned) <= {2, 3, 5, 6, 9}
    assert found.expected_ront_um < 0.2
    path = found.next.path
    harmonics = {harmonic.lobes: harmonic for harmonic in path.target.overtones}
    assert (harmonics[5].amplitude_um, harmonics[5].phase_deg % 72.0) == pytest.approx((2.0, 11.0), abs=0.1)
    assert harmonics[2].amplitude_um == pytest.approx(1.5, abs=0.02)
    assert plan_cut(JOB.job, LATHE.machine, Strategy.CAM, path=path).target == path.target
    plain = lesson(tmp_path, "cam", ()).step
    assert not {2, 5} & set(plain.learned)
    assert plain.expected_ront_um > 3.0


def test_the_command_line_asks_for_them(console: Console, tmp_path: Path) -> None:
    path = tmp_path / "part.csv"
    head = ("state: free", "simulated: yes", "direction: spindle", "start_mark: spindle index")
    cut = ("compensation: none", "strategy: cam", "stage: full")
    rows = [f"{a:g},{d:.4f}" for a, d in zip(ANGLE, OFF_UM, strict=True)]
    path.write_text("\n".join([*(f"# {line}" for line in (*head, *cut)), "angle_deg,deviation_um", *rows]))
    said = console("learn", str(path), "--job", JOB.job.name, "--extra", "2,5", "--json")
    assert (said.code, {2, 5} <= set(said.json["learned_waves"])) == (0, True)
    refused_words = console("learn", str(path), "--job", JOB.job.name, "--extra", "1")
    assert refused_words.code == 1 and "1/rev" in refused_words.err
    unused = console("learn", "--list", "--job", JOB.job.name, "--extra", "5")
    assert unused.code == 1 and "--extra" in unused.err


def test_waves_that_cannot_be_cut_are_refused(tmp_path: Path) -> None:
    assert [p.limit for p in refused(tmp_path, "pvt", (5,))] == ["--strategy cam"]
    # Once a turn is the place of the part on the gauge; 48 times a turn at 1000 rpm, 800 Hz, nothing follows.
    problems = refused(tmp_path, "cam", (1, 51, 48, 4))
    assert [p.code for p in problems] == 3 * ["learned.extra"]
    assert [p.value.partition(" ")[0] for p in problems] == ["1/rev", "51/rev", "48/rev"]
