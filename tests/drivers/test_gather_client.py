"""A client that gathers: what it returns is what the simulated axes did, to the count, in both families."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
import pytest

from drivers.errors import ControllerError
from drivers.pmac.client import PmacClient
from drivers.pmac.gathering.gather import GatherError
from drivers.pmac.gathering.gather_client import DataGathering, GatheredData, GatherPlan
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.commissioned import HeardPort, commissioned, of_family

HARMLESS = re.compile(r"I\d+(=\d+)?( I\d+(=\d+)?)*|\?\?\?|DEFINE GATHER \d+|GATHER|ENDGATHER|LIST GATHER \d+,\d+")


@dataclass(kw_only=True)
class Bench:
    """`tracks` are the true positions in counts, from the first servo cycle that is gathered on."""

    sim: SimulatedLathe
    line: HeardPort
    client: PmacClient
    gathering: DataGathering
    tracks: dict[int, list[float]] = field(default_factory=dict)

    def run_block(self, cycles: int) -> dict[int, list[float]]:
        controller = self.sim.controller
        gathers = controller.gather.running
        tracks = type(controller).run_block(controller, cycles)
        if gathers:
            for motor, track in tracks.items():
                self.tracks.setdefault(motor, []).extend(track)
        return tracks

    def gathered(self, plan: GatherPlan) -> GatheredData:
        self.gathering.start(plan)
        self.sim.wait(plan.duration_ms / 1000.0 + 0.02)
        self.gathering.stop()
        return self.gathering.fetch(plan)


@pytest.fixture(params=["pmac", "turbo"])
def bench(machine: MachineProfile, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Bench:
    card = commissioned(of_family(machine, request.param))
    gathering = DataGathering(client=card.client, dialect=card.dialect)
    made = Bench(sim=card.sim, line=card.line, client=card.client, gathering=gathering)
    monkeypatch.setattr(card.sim.controller, "run_block", made.run_block)
    return made


def encoder_counts(bench: Bench, motor: int) -> list[int]:
    """What the encoder makes of the true positions: whole counts from where the motor was switched on."""
    origin = bench.sim.controller.motors[motor].axis.origin
    return [round(counts - origin) for counts in bench.tracks[motor]]


@pytest.mark.parametrize("period", [1, 3])
def test_what_is_gathered_is_what_the_axes_did(bench: Bench, period: int) -> None:
    bench.client.request("#1J/ #2J/ #3J/")
    gathering, samples = bench.gathering, 301
    plan = gathering.prepare(
        gathering.motor_channels("#1 actual", "#2 actual", "#3 actual", "#1 velocity"), samples, period
    )
    bench.client.request("#1J:300 #2J+ #3J:-500")
    data = bench.gathered(plan)
    assert data.times_ms.tolist() == pytest.approx(
        [k * period * bench.sim.controller.cycle_ms for k in range(samples)]
    )
    for motor in (1, 2, 3):
        counts = encoder_counts(bench, motor)
        assert len(counts) >= samples * period
        assert np.ptp(counts) > 100, "it moved"
        assert data.values[f"#{motor} actual"].tolist() == counts[: samples * period : period]
    steps = np.diff(encoder_counts(bench, 1))
    assert data.values["#1 velocity"][1:].tolist() == steps[period - 1 : samples * period - 1 : period].tolist()
    assert data.units["#1 velocity"] == "counts/cycle"


def test_a_plc_at_the_interrupts_neither_adds_nor_takes_a_sample(bench: Bench) -> None:
    bench.client.request("I5=3 #1J/")
    for line in ("OPEN PLC 0 CLEAR", "P1=P1+1", "CLOSE", "ENABLE PLC 0"):
        bench.client.request(line)
    plan = bench.gathering.prepare(bench.gathering.motor_channels("#1 actual"), 300)
    bench.client.request("#1J:300")
    data = bench.gathered(plan)
    assert float(bench.client.query("P1")[0]) > 10
    assert data.values["#1 actual"].tolist() == encoder_counts(bench, 1)[:300]
    assert np.ptp(data.values["#1 actual"]) > 100


def test_the_commanded_position_of_a_jog_is_a_straight_line_between_its_ramps(bench: Bench) -> None:
    """Ix22 counts a ms are Ix22 times the servo time in each servo cycle."""
    bench.client.request("#2J/ I219=1 I220=10 I221=0 I222=40 #2J+")
    bench.sim.wait(0.1)
    plan = bench.gathering.prepare(bench.gathering.motor_channels("#2 commanded"), 100)
    data = bench.gathered(plan)
    step = 40 * bench.sim.controller.cycle_ms
    # A register holds 1/3072 count.
    assert np.diff(data.values["#2 commanded"]) == pytest.approx(np.full(99, step), abs=1 / 3072)


def test_nothing_moves_because_of_it(bench: Bench) -> None:
    bench.line.heard = b""
    plan = bench.gathering.prepare(bench.gathering.motor_channels("#1 actual", "#3 commanded"), 50)
    data = bench.gathered(plan)
    assert all(np.ptp(values) == 0 for values in data.values.values())
    assert not any(motor.enabled for motor in bench.sim.controller.motors.values())
    said = bench.line.heard.decode("ascii").split("\r")[:-1]
    assert len(said) > 5
    assert [line for line in said if HARMLESS.fullmatch(line) is None] == []


def test_a_long_gather_is_listed_in_parts(bench: Bench) -> None:
    plan = bench.gathering.prepare(bench.gathering.motor_channels("#1 actual", "#2 actual"), 400)
    bench.line.heard = b""
    assert bench.gathered(plan).times_ms.shape == (400,)
    listed = re.findall(rb"LIST GATHER (\d+),(\d+)\r", bench.line.heard)
    assert listed == [(b"0", b"256"), (b"256", b"256"), (b"512", b"256"), (b"768", b"32")]


def test_one_that_is_stopped_early_has_fewer_samples(bench: Bench) -> None:
    plan = bench.gathering.prepare(bench.gathering.motor_channels("#1 actual"), 10_000)
    bench.gathering.start(plan)
    bench.sim.wait(0.1)
    bench.gathering.stop()
    data = bench.gathering.fetch(plan)
    assert len(bench.tracks[1]) == len(data.times_ms) == len(data.values["#1 actual"])
    assert 200 < len(data.times_ms) < 400


def test_a_second_start_begins_with_an_empty_buffer(bench: Bench) -> None:
    """Samples of two gathers in a row would be taken for one."""
    plan = bench.gathering.prepare(bench.gathering.motor_channels("#1 actual"), 1000)
    bench.gathered(plan)
    bench.tracks.clear()
    bench.gathering.start(plan)
    bench.sim.wait(0.05)
    bench.gathering.stop()
    assert len(bench.gathering.fetch(plan).times_ms) == len(bench.tracks[1]) < 200


@pytest.mark.parametrize("i9", range(4))
def test_settings_are_read_in_every_form_that_a_card_tells_them_in(bench: Bench, i9: int) -> None:
    bench.client.request(f"I9={i9} I108=48")
    (channel,) = bench.gathering.motor_channels("#1 actual")
    assert channel.scale == 1 / (48 * 32)
    plan = bench.gathering.prepare([channel], 10)
    assert plan.cycle_ms == bench.sim.controller.cycle_ms
    assert bench.gathered(plan).values["#1 actual"].shape == (10,)


@pytest.mark.parametrize("name", ["spindle", "#0 actual", "#33 actual", "#1", "1 actual velocity"])
def test_a_name_that_is_none_is_refused(bench: Bench, name: str) -> None:
    with pytest.raises(GatherError, match=r"as in '#1 actual', motors 1 to (8|32)"):
        bench.gathering.motor_channels(name)


def test_a_register_or_a_scale_that_is_none_is_refused(bench: Bench) -> None:
    with pytest.raises(GatherError, match="there are commanded, actual"):
        bench.gathering.motor_channels("#1 temperature")
    bench.client.request("I108=0")
    with pytest.raises(GatherError, match=r"I108 is 0\.0; above 0"):
        bench.gathering.motor_channels("#2 actual", "#1 actual")


@pytest.mark.parametrize(("samples", "period"), [(0, 1), (1, 0), (1, -1), (1, 8_388_608)])
def test_a_plan_that_is_none_is_refused(bench: Bench, samples: int, period: int) -> None:
    channels = bench.gathering.motor_channels("#1 actual")
    with pytest.raises(GatherError, match="from 1 sample on, 1 to 8388607 cycles"):
        bench.gathering.prepare(channels, samples, period)


def test_more_than_the_card_has_room_for_is_refused_with_what_to_do(bench: Bench) -> None:
    channels = bench.gathering.motor_channels("#1 actual")
    room = int(bench.client.query("SIZE")[0])
    bench.gathering.prepare(channels, room - 48)
    with pytest.raises(GatherError, match=r"no room for .* fewer channels, or fewer samples at a longer period"):
        bench.gathering.prepare(channels, room - 47)


def test_the_gather_of_somebody_else_is_left_alone(bench: Bench) -> None:
    channels = bench.gathering.motor_channels("#1 actual")
    plan = bench.gathering.prepare(channels, 10_000)
    bench.gathering.start(plan)
    assert bench.gathering.running()
    with pytest.raises(GatherError, match="somebody gathers already"):
        bench.gathering.prepare(channels, 5)
    with pytest.raises(GatherError, match="not at its end yet"):
        bench.gathering.fetch(plan)
    bench.gathering.stop()
    assert len(bench.gathering.fetch(plan).times_ms) > 10


def test_settings_never_become_lines_of_a_program_that_is_being_entered(bench: Bench) -> None:
    channels = bench.gathering.motor_channels("#1 actual")
    bench.client.request("OPEN PROG 1 CLEAR")
    with pytest.raises(GatherError, match="CLOSE it first"):
        bench.gathering.prepare(channels, 5)
    bench.client.request("CLOSE")
    assert bench.client.request("LIST PROG 1") == ("RET",)


@pytest.mark.parametrize("change", ["source", "period", "I10"])
def test_data_of_another_set_up_are_not_taken_for_ours(bench: Bench, change: str) -> None:
    places = bench.gathering.dialect.gathering
    plan = bench.gathering.prepare(bench.gathering.motor_channels("#1 actual"), 10)
    lines = {"source": f"I{places.first_source}=$800200", "period": f"I{places.period}=7", "I10": "I10=5000000"}
    bench.client.request(lines[change])
    with pytest.raises(GatherError, match="start over"):
        bench.gathered(plan)


def test_nothing_is_fetched_that_was_never_started(bench: Bench) -> None:
    plan = bench.gathering.prepare(bench.gathering.motor_channels("#1 actual"), 10)
    with pytest.raises(ControllerError) as refused:
        bench.gathering.fetch(plan)
    assert refused.value.error_number == 3


def test_a_scale_that_was_changed_meanwhile_is_told_and_not_used(bench: Bench) -> None:
    plan = bench.gathering.prepare(bench.gathering.motor_channels("#1 actual"), samples=5)
    bench.gathering.start(plan)
    bench.sim.wait(0.05)
    bench.gathering.stop()
    bench.client.request("I108=48")
    with pytest.raises(GatherError, match=r"#1 actual.*1536 steps.*3072 before"):
        bench.gathering.fetch(plan)


def test_the_gathered_output_is_that_of_the_control_law_on_command_and_position(bench: Bench) -> None:
    """User Manual: 2^-19 Ix30 {Ix08 [FE + Ix32 CV/128] - Ix31 Ix09 AV/128}, in counts and cycles; Ix33 is 0."""
    bench.client.request("I130=528 I131=4905 I132=4905 I133=0 I119=40 I120=5 I121=0 I122=200")
    bench.client.request("#1J/")
    names = ("#1 commanded", "#1 actual", "#1 output")
    plan = bench.gathering.prepare(bench.gathering.motor_channels(*names), 60)
    bench.client.request("#1J:-1000")
    data = bench.gathered(plan)
    command, actual, output = (data.values[name] for name in names)
    ix08, ix09 = bench.client.numbers("I108", "I109")
    fast, slow = ix08 * np.diff(command), ix09 * np.diff(actual)
    law = ix08 * (command - actual)[1:] + 4905 * (fast - slow) / 128
    assert data.units["#1 output"] == "DAC bits" and np.ptp(output) > 100.0
    # The output is listed in whole bits, the command in 1/3072 of a count.
    assert np.abs(output[1:] - 528 * law / 2**19).max() < 1.0
