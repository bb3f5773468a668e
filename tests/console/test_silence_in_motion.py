"""A controller that falls silent in motion, and answers again: what is said in the meantime is the case."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from console.session.station.commands import EnableDrives, Home
from console.session.station.state import Activity, StationState
from tests.console.floor import Floor, open_floor

SILENT_S = 3.0


class Silence:
    """A link on which nobody answers for some seconds; what is sent meanwhile is lost."""

    def __init__(self, floor: Floor, patch: pytest.MonkeyPatch) -> None:
        self._floor, self.began_s = floor, float("inf")
        self._receive = floor.link.receive
        patch.setattr(floor.link, "receive", self.receive)
        for name in ("send", "send_urgent"):
            patch.setattr(floor.link, name, self._sending(getattr(floor.link, name)))

    @property
    def is_on(self) -> bool:
        return self.began_s <= self._floor.sim.now_s() < self.began_s + SILENT_S

    def receive(self, timeout_s: float) -> bytes:
        if not self.is_on:
            return self._receive(timeout_s)
        self._floor.sim.wait(timeout_s)
        return b""

    def _sending(self, send: Callable[[bytes], None]) -> Callable[[bytes], None]:
        return lambda data: None if self.is_on else send(data)


def test_a_silence_in_motion_is_lost_within_a_second_and_an_answer_is_the_proof_of_the_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once it answers, nobody is told that it does not: what is left is to see it at rest."""
    floor = open_floor(tmp_path, owned=True)
    floor.do(EnableDrives())
    silence = Silence(floor, monkeypatch)
    told: list[tuple[float, StationState]] = []
    tell = floor.context.tell

    def listen(**changes: object) -> None:
        tell(**changes)
        told.append((floor.sim.now_s(), floor.context.state))

    monkeypatch.setattr(floor.context, "tell", listen)

    def begin() -> None:
        silence.began_s = floor.sim.now_s()

    floor.when(lambda seen: "desired_velocity_zero" not in seen.tool.flags, begin)
    floor.station.post(Home())
    floor.station.step()
    began_s = silence.began_s
    moving = next(state for at_s, state in reversed(told) if at_s <= began_s and state.snapshot is not None)
    assert not moving.is_unanswered(began_s + 0.3) and moving.is_unanswered(began_s + 0.75)
    lost_s = next(at_s for at_s, state in told if state.activity is Activity.LOST)
    assert lost_s - began_s < 1.0
    again = [state for at_s, state in told if at_s > began_s + SILENT_S]
    answered = next(place for place, state in enumerate(again) if state.snapshot is not moving.snapshot)
    assert {state.activity for state in again[answered + 1 :]} <= {Activity.STOPPING, Activity.STOPPED}
    assert floor.state.activity is Activity.STOPPED
