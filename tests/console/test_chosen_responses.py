"""Cutting with an identified response chosen on the screen or on the command line; the record says which."""

from __future__ import annotations

import cmath
import math
from pathlib import Path
from typing import Any

import pytest

from console.session.data.identified import asked_response, kept_responses, store
from console.session.data.run_reader import measured_parts, runs, story
from console.session.errors import SessionError
from drivers.cutting.strategy import Strategy
from drivers.identification.nominal import nominal_response
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, Origin
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_machine
from tests.console.commands import Console
from tests.console.test_learning_on_the_screen import Shop, lobe_um_pp
from tests.console.test_learning_on_the_screen import shop as shop  # a fixture

EXPERIMENT = "lee-2001-experiment-1"
MACHINE = load_machine("lee-2001-lathe").machine
NEW = "2026-01-03T09:30:00.000Z"


def of_model(
    machine: MachineProfile, path: Strategy, date: str, factor: float = 1.0, **of: Any
) -> IdentifiedResponse:
    """The response of the model, or a fraction of it, as if it had been identified."""
    variables, motor = machine.controller.variables, machine.tool.motor
    gains = {name: variables[name] for number in range(30, 36) if (name := f"I{motor}{number}") in variables}
    kind = "TURBO PMAC2" if machine.controller.family == "turbo" else "PMAC1, X1"
    told = {"machine": machine.name, "simulated": True, "version": "1.17", "kind": kind, "gains": gains}
    points = []
    for hz in (10.0, 30.0, 50.0, 80.0):
        found = factor * nominal_response(path, machine, hz)
        points.append(
            IdentifiedPoint(
                frequency_hz=hz,
                gain=abs(found),
                phase_deg=math.degrees(cmath.phase(found)),
                gain_ci=0.002,
                phase_ci_deg=0.1,
                coherence=0.999,
                amplitude_um=30.0,
            )
        )
    period_ms = machine.controller.servo_period_ms
    return IdentifiedResponse(
        origin=Origin(**{**told, "servo_period_ms": period_ms, **of}),
        path=path,
        how="measured",
        delay_cycles=0,
        date=date,
        points=tuple(points),
    )


def test_newest_a_name_and_a_file_are_the_same_response(tmp_path: Path) -> None:
    store(tmp_path, of_model(MACHINE, Strategy.PVT, "2026-01-01T00:00:00.000Z"))
    file = store(tmp_path, of_model(MACHINE, Strategy.PVT, NEW, 0.9))
    found = [asked_response(tmp_path, asked, MACHINE, Strategy.PVT) for asked in ("newest", file.name, str(file))]
    assert [each.identified for each in found] == [found[0].identified] * 3
    assert found[0].name == file.name and found[0].identified.date == NEW
    with pytest.raises(SessionError, match="is kept for strategy"):
        kept_responses(tmp_path, MACHINE, Strategy.CAM)
    outside = file.parent.parent / file.name
    file.rename(outside)
    with pytest.raises(ProfileError) as refused:
        asked_response(tmp_path, f"../{file.name}", MACHINE, Strategy.PVT)
    assert refused.value.problems[0].code == "file.unreadable"


def test_a_file_that_cannot_be_read_leaves_the_others(tmp_path: Path) -> None:
    good = store(tmp_path, of_model(MACHINE, Strategy.PVT, NEW))
    (good.parent / "pvt-99990101T000000000Z.json").write_text("{", encoding="ascii")
    assert [each.file for each in kept_responses(tmp_path, MACHINE, Strategy.PVT)] == [good]


def test_the_command_refuses_the_newest_of_a_strategy_that_has_none(console: Console, data_folder: Path) -> None:
    data = data_folder / "trilobe"
    store(data, of_model(MACHINE, Strategy.PVT, NEW))
    refused = console("preview", EXPERIMENT, "--strategy", "cam", "--identified", "newest")
    assert refused.code == 1 and "console identify" in refused.err


@pytest.mark.long
def test_the_cut_inverts_the_chosen_response_and_its_record_says_so(shop: Shop) -> None:
    """A response of 0.8 of the model commands another path, and the part teaches by that path."""
    machine = shop.machine.machine
    file = store(shop.data, of_model(machine, Strategy.CAM, NEW, 0.8))
    (kept,) = kept_responses(shop.data, machine, Strategy.CAM, simulated=True)
    assert shop.refused(inverts=kept, strategy=Strategy.PVT) == ["response.of_another"]
    by_model = shop.armed()
    armed = shop.armed(inverts=kept)
    assert armed.made.inverted == file.name and by_model.made.inverted == "model"
    assert armed.plan.text != by_model.plan.text
    content = file.read_text("utf-8")
    file.write_text(content.replace("0.999", "0.998"), encoding="utf-8")
    assert shop.refused(inverts=kept) == ["response.file_changed"]
    file.unlink()
    assert shop.refused(inverts=kept) == ["file.unreadable"]
    file.write_text(content, encoding="utf-8")

    part = shop.part(inverts=kept)
    assert part.learning is not None and part.learning.problems == (), "what it was cut with is found by its name"
    assert part.learning.made.inverted == file.name
    (row, *_) = runs(shop.data)
    assert story(shop.data, row.run_id).setup["inverted"] == file.name
    (point,) = measured_parts(shop.data, shop.job.job.name, machine.name, True)
    assert (row.inverted, point.inverted, row.compensation) == (file.name, file.name, "none")
    assert lobe_um_pp(part) > 0.0
