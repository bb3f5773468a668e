"""The faults that can be asked for, and the lines that ask for them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import RefusedError
from drivers.lathe.snapshot import AxisName
from drivers.simulator.__main__ import answer as answer_on_channel
from drivers.simulator.faults.catalogue import CATALOGUE, Fault, Parameter, Value
from drivers.simulator.hosts.control_socket import answer
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import ideal
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench, JobMaker
from tests.drivers.test_spindle_drives import with_inverter

DOCUMENT = Path(__file__).parents[2] / "docs" / "faults.md"
CYCLE_S = 0.005
ASKED_FOR = (
    "split-segments dropped-ack late-reply extra-line nul wrong-checksum bare-bel garbled-line cut-cable hang"
    " 9600-baud encoder-loss index-lost amplifier-fault limit following-error-trip spindle-ripple watchdog"
    " slow-background stranger-writes"
).split()


@pytest.fixture
def lathe(machine: MachineProfile) -> SimulatedLathe:
    return SimulatedLathe(machine)


def names(lathe: SimulatedLathe) -> list[str]:
    return [injected.fault.name for injected in lathe.faults.active()]


def problem_of(action: Callable[[], object]) -> tuple[str, str, str, str]:
    with pytest.raises(RefusedError) as error:
        action()
    (problem,) = error.value.problems
    assert problem.code == "simulator.fault"
    return problem.where, problem.key, problem.value, problem.limit


def test_the_catalogue_has_what_was_asked_for() -> None:
    assert list(CATALOGUE) == ASKED_FOR


@pytest.mark.parametrize("fault", CATALOGUE.values(), ids=CATALOGUE)
def test_each_fault_begins_by_default_and_is_undone(lathe: SimulatedLathe, fault: Fault) -> None:
    """So that there is none without an effect, nor one that stays."""
    assert fault.does.endswith(".")
    lathe.faults.inject(fault.name)
    lathe.wait(0.02)
    lathe.faults.clear()
    lathe.power_cycle()
    assert lathe.faults.active() == ()
    port = lathe.connect()
    port.receive(b"I3=2\rP1\r")
    lathe.wait(0.02)
    assert port.take_output().endswith(b"0\r\x06")
    assert [motor.fault_input or motor.index_lost for motor in lathe.controller.motors.values()] == [False] * 8


def test_a_fault_begins_and_ends_in_simulated_time(lathe: SimulatedLathe) -> None:
    lathe.wait(1.0)
    injected = lathe.faults.inject("amplifier-fault", after_s=0.2, for_s=0.3)
    assert injected.begins_s == pytest.approx(1.2, abs=CYCLE_S)
    assert injected.ends_s - injected.begins_s == pytest.approx(0.3)
    motor = lathe.controller.motors[1]
    there = []
    for _ in range(140):
        lathe.wait(CYCLE_S)
        there.append((lathe.now_s(), motor.fault_input))
    assert all(faulty == (injected.begins_s <= now_s < injected.ends_s) for now_s, faulty in there)
    assert names(lathe) == []


def test_several_are_listed_in_the_order_in_which_they_were_asked_for(lathe: SimulatedLathe) -> None:
    lathe.faults.inject("nul", after_s=9)
    lathe.faults.inject("hang", for_s=0.1)
    lathe.faults.inject("limit")
    assert names(lathe) == ["nul", "hang", "limit"]
    lathe.wait(0.2)
    assert names(lathe) == ["nul", "limit"]
    lathe.faults.clear()
    lathe.wait(10.0)
    assert names(lathe) == []
    assert lathe.lines.spoilers == []


@pytest.mark.parametrize(
    ("name", "given", "key", "value", "limit"),
    [
        ("no-such", {}, "fault", "no-such", "split-segments, dropped-ack"),
        ("hang", {"delay_ms": 3}, "parameter", "delay_ms", "after, for, seed"),
        ("hang", {"after_s": -1}, "after", "-1", "0 <= after <= 86400"),
        ("hang", {"after_s": 10**400}, "after", "an integer that is too large", "0 <= after <= 86400"),
        ("hang", {"after_s": 10**5000}, "after", "an integer that is too large", "0 <= after <= 86400"),
        ("hang", {"after_s": None}, "after", "None", "0 <= after <= 86400"),
        ("hang", {"after_s": [1]}, "after", "[1]", "0 <= after <= 86400"),
        ("hang", {"after_s": True}, "after", "True", "0 <= after <= 86400"),
        ("hang", {"after_s": b"1"}, "after", "b'1'", "0 <= after <= 86400"),
        ("hang", {"for_s": 0}, "for", "0", "0 < for <= 86400"),
        ("hang", {"for_s": float("nan")}, "for", "nan", "0 < for <= 86400"),
        ("nul", {"seed": "1_0"}, "seed", "1_0", "0 <= seed <= 1e+09, whole"),
        ("nul", {"seed": "\u0661"}, "seed", "\\u0661", "0 <= seed <= 1e+09, whole"),
        ("nul", {"seed": " 1"}, "seed", " 1", "0 <= seed <= 1e+09, whole"),
        ("nul", {"share": "x" * 200}, "share", "x" * 80 + "...", "0 < share <= 1"),
        ("nul", {"seed": 0.5}, "seed", "0.5", "0 <= seed <= 1e+09, whole"),
        ("nul", {"share": 0}, "share", "0", "0 < share <= 1"),
        ("nul", {"share": "half"}, "share", "half", "0 < share <= 1"),
        ("nul", {"replies": 1.5}, "replies", "1.5", "1 <= replies <= 1e+06, whole"),
        ("limit", {"motor": "turret"}, "motor", "turret", "tool | spindle | carriage"),
        ("limit", {"motor": 1}, "motor", "1", "tool | spindle | carriage"),
        ("slow-background", {"cycle_ms": 9}, "cycle_ms", "9", "10 <= cycle_ms <= 10000"),
        ("stranger-writes", {"line": "P1\r"}, "line", "P1\\r", "a line of printable characters"),
        ("stranger-writes", {"line": ""}, "line", "", "a line of printable characters"),
        ("watchdog", {"for_s": 1}, "parameter", "for", "after, seed"),
    ],
)
def test_what_is_refused_says_what_with_which_value_and_what_is_allowed(
    lathe: SimulatedLathe, name: str, given: dict[str, Any], key: str, value: str, limit: str
) -> None:
    where, met_key, met, allowed = problem_of(lambda: lathe.faults.inject(name, **given))
    assert (where, met_key, met) == (name, key, value)
    assert allowed.startswith(limit)
    assert names(lathe) == []


def parameters() -> list[tuple[Fault, Parameter]]:
    return [(fault, one) for fault in CATALOGUE.values() for one in fault.parameters]


@pytest.mark.parametrize(("fault", "parameter"), parameters(), ids=lambda item: item.name)
def test_defaults_and_both_ends_of_each_range_are_allowed(fault: Fault, parameter: Parameter) -> None:
    allowed: list[Value]
    if parameter.choices or parameter.text:
        allowed = [*(parameter.choices or ("P1=2",))]
    else:
        allowed = [parameter.most, *([] if parameter.above_least else [parameter.least])]
        assert problem_of(lambda: parameter.check(parameter.most + 1, fault.name))
        assert problem_of(lambda: parameter.check(parameter.least - 1, fault.name))
    for value in allowed:
        assert parameter.check(value, fault.name) == value
    assert parameter.default is None or parameter.check(parameter.default, fault.name) == parameter.default


def test_there_are_a_thousand_at_once_and_no_more(lathe: SimulatedLathe) -> None:
    for _ in range(1000):
        lathe.faults.inject("nul", after_s=9)
    assert problem_of(lambda: lathe.faults.inject("hang")) == (
        "hang",
        "fault",
        "1001",
        "1000 at once; `clear` ends them",
    )
    lathe.faults.clear()
    lathe.faults.inject("hang")


def test_a_card_that_a_slow_background_has_killed_is_told_as_dead(lathe: SimulatedLathe) -> None:
    """512 real-time interrupts of 3 servo cycles are 0.68 s."""
    lathe.faults.inject("slow-background", cycle_ms=10_000)
    lathe.wait(1.0)
    *_, told, verdict = answer(lathe, "active").splitlines()
    found = re.fullmatch(r"card shut down by its watchdog at (\d\.\d{3}) s; power-cycle", told)
    assert verdict == "ok"
    assert found is not None
    assert float(found[1]) == pytest.approx(0.68, abs=0.01)
    assert answer(lathe, "clear") == f"{told}\nok\n"
    assert answer(lathe, "active") == f"{told}\nok\n"
    assert answer(lathe, "power-cycle") == "ok\n"
    assert answer(lathe, "active") == "ok\n"


def test_two_watchdogs_are_both_over_with_a_power_cycle(lathe: SimulatedLathe) -> None:
    lathe.faults.inject("watchdog")
    lathe.faults.inject("watchdog")
    lathe.faults.inject("watchdog", after_s=1.0)
    lathe.power_cycle()
    port = lathe.connect()
    port.receive(b"I3=2\rP1\r")
    lathe.wait(0.02)
    assert port.take_output().endswith(b"0\r\x06")
    assert answer(lathe, "active") == "watchdog seed=0, at 1.000 s (waits)\nok\n"


def test_a_line_of_text_does_the_same_as_a_call(lathe: SimulatedLathe) -> None:
    said = answer(lathe, "inject late-reply after=1.5 for=0.2 delay_ms=300 share=0.5 seed=3")
    assert said.splitlines() == ["late-reply delay_ms=300 share=0.5 seed=3, from 1.500 s to 1.700 s (waits)", "ok"]
    typed = lathe.faults.active()
    lathe.faults.clear()
    called = lathe.faults.inject("late-reply", after_s=1.5, for_s=0.2, delay_ms=300, share=0.5, seed=3)
    assert typed == (called,)


def test_the_words_of_the_control_socket(lathe: SimulatedLathe) -> None:
    listed = answer(lathe, "list").splitlines()
    assert [line.partition(":")[0] for line in listed] == [*ASKED_FOR, "ok"]
    explained = answer(lathe, "help slow-background")
    assert "cycle_ms (ms): background cycle; 10 <= cycle_ms <= 10000; default 50\n" in explained
    assert answer(lathe, "active") == "ok\n"
    assert answer(lathe, "inject stranger-writes 'line=P1=3 P2=4'").endswith("\nok\n")
    assert answer(lathe, "inject watchdog").endswith("\nok\n")
    shut_down = "card shut down by its watchdog at 0.000 s; power-cycle\n"
    assert answer(lathe, "active") == f"watchdog seed=0, at 0.000 s\n{shut_down}ok\n"
    assert answer(lathe, "clear") == f"{shut_down}ok\n"
    assert lathe.controller.watchdog_tripped
    assert answer(lathe, "power-cycle") == "ok\n"
    assert answer(lathe, "active") == "ok\n"


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("", "command '' is not possible; allowed: list | help NAME"),
        ("inject", "command 'inject' is not possible; allowed: list | help NAME"),
        ("list all", "command 'list all'"),
        ("help me", "fault 'me' is not possible; allowed: split-segments, "),
        ("inject hang for", "hang: setting 'for' is not possible; allowed: KEY=VALUE"),
        ("inject hang for=1 for=2", "hang: setting 'for=2' is not possible; allowed: KEY=VALUE, each key once"),
        ("inject hang after_s=1", "hang: parameter 'after_s' is not possible; allowed: after, for, seed"),
        ("inject hang name=x self=y", "hang: parameter 'name' is not possible"),
        ("inject nul share=2", "nul: share '2' is not possible; allowed: 0 < share <= 1; `help nul` tells more"),
        ("inject hang 'for=1", "command 'inject hang 'for=1 (No closing quotation)' is not possible"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(lathe: SimulatedLathe, line: str, said: str) -> None:
    told = answer(lathe, line)
    assert told.startswith(f"refused: {said}")
    assert told.count("\n") == 1
    assert re.search(r"`(list|help [a-z-]+)` tells more\n$", told)
    assert names(lathe) == []


@given(st.text(max_size=60))
def test_whatever_is_typed_there_is_one_verdict(line: str) -> None:
    class Nobody:
        """What is typed at random never gets as far as a machine."""

        faults = None

        def now_s(self) -> float:
            return 0.0

    lines = answer(Nobody(), f"bogus {line}").splitlines()  # type: ignore[arg-type]
    assert len(lines) == 1
    assert lines[0].startswith("refused: ")


def test_the_private_channel_passes_lines_on(lathe: SimulatedLathe) -> None:
    said = answer_on_channel(lathe, b'{"do": "fault", "line": "inject nul seed=4"}\n')
    assert said["said"].endswith("until it is cleared\nok\n")
    assert names(lathe) == ["nul"]
    refused = answer_on_channel(lathe, b'{"do": "fault", "line": "inject lightning"}\n')
    assert refused["refused"].startswith("fault 'lightning' is not possible; allowed: split-segments")


def _rows() -> dict[str, list[str]]:
    """The table of the document: what a fault does, whom it concerns, and what it can be told."""
    found = re.findall(
        r"^\| `([\w-]+)` \| (.*) \| (.*) \| (.*) \|$", DOCUMENT.read_text(encoding="utf-8"), re.MULTILINE
    )
    return {name: rest for name, *rest in found}


def _parameter_in_words(parameter: Parameter) -> str:
    words = f"`{parameter.name}`: {parameter.range_text}".replace(" | ", ", ")
    if parameter.default is None:
        return words
    shown = f"{parameter.default:g}" if isinstance(parameter.default, float) else parameter.default
    return f"{words} ({shown})"


def test_the_document_says_what_the_catalogue_says() -> None:
    assert _rows() == {
        fault.name: [fault.does, str(fault.concerns), "; ".join(map(_parameter_in_words, fault.parameters)) or "-"]
        for fault in CATALOGUE.values()
    }


# What people do and see at a served lathe, asked for in a line of text or over the private channel.

SECONDS_TO_800_RPM = 1.6
"""At 500 rpm/s."""


@pytest.fixture
def driven_by_hand(machine: MachineProfile) -> SimulatedLathe:
    machine = with_inverter(machine)
    return SimulatedLathe(machine, ideal(machine))


def speed_rpm(lathe: SimulatedLathe) -> float:
    """By the encoder, over a tenth of a second."""
    motor = lathe.controller.motors[2]
    before, began_s = motor.actual, lathe.now_s()
    lathe.wait(0.1)
    return (motor.actual - before) / 10_000 * 60 / (lathe.now_s() - began_s)


def asked(lathe: SimulatedLathe, **request: object) -> dict[str, object]:
    return answer_on_channel(lathe, json.dumps(request).encode() + b"\n")


@pytest.mark.parametrize("rpm", ["800", "-800", "8e2"])
def test_an_inverter_spindle_is_set_and_switched_off_in_a_line(driven_by_hand: SimulatedLathe, rpm: str) -> None:
    assert answer(driven_by_hand, f"spindle {rpm}") == "ok\n"
    driven_by_hand.wait(SECONDS_TO_800_RPM + 0.1)
    assert speed_rpm(driven_by_hand) == pytest.approx(float(rpm), rel=0.02)
    assert answer(driven_by_hand, "spindle off") == "ok\n"
    driven_by_hand.wait(1.0)
    assert 0.0 < speed_rpm(driven_by_hand) / float(rpm) < 0.6


def test_an_inverter_spindle_is_set_over_the_private_channel(driven_by_hand: SimulatedLathe) -> None:
    assert asked(driven_by_hand, do="spindle", rpm=800) == {}
    driven_by_hand.wait(SECONDS_TO_800_RPM + 0.1)
    assert speed_rpm(driven_by_hand) == pytest.approx(800, rel=0.02)
    assert asked(driven_by_hand, do="spindle", rpm=None) == {}
    driven_by_hand.wait(1.0)
    assert speed_rpm(driven_by_hand) < 480


@pytest.mark.parametrize("value", ["800", "off"])
def test_a_spindle_that_the_card_drives_is_not_set_by_hand(machine: MachineProfile, value: str) -> None:
    lathe = SimulatedLathe(machine)
    said = answer(lathe, f"spindle {value}")
    assert said.startswith(f"refused: spindle '{value}' is not possible; the controller drives this spindle")
    assert said.count("\n") == 1
    refused = asked(lathe, do="spindle", rpm=None if value == "off" else float(value))
    assert str(refused["refused"]).startswith("the controller drives this spindle")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("spindle 3001", "spindle '3001' is not possible; the spindle turns at most 3000 rpm"),
        ("spindle nan", "spindle 'nan' is not possible; the spindle turns at most 3000 rpm"),
        ("spindle fast", "spindle 'fast' is not possible; allowed: RPM | off"),
        ("spindle '8\u00e4\t'", "spindle '8\\xe4\\t' is not possible; allowed: RPM | off"),
        ("spindle", "command 'spindle' is not possible; allowed: list | help NAME"),
        ("spindle on at 800", "command 'spindle on at 800' is not possible"),
        ("collisions all", "command 'collisions all' is not possible"),
    ],
)
def test_what_is_no_speed_is_refused_in_one_line(driven_by_hand: SimulatedLathe, line: str, said: str) -> None:
    told = answer(driven_by_hand, line)
    assert told.startswith(f"refused: {said}")
    assert told.count("\n") == 1
    driven_by_hand.wait(1.0)
    assert speed_rpm(driven_by_hand) == 0.0


@pytest.mark.parametrize("request_", [{"rpm": "fast"}, {"rpm": [1]}, {}])
def test_a_request_without_a_speed_is_refused(driven_by_hand: SimulatedLathe, request_: dict[str, object]) -> None:
    assert "refused" in asked(driven_by_hand, do="spindle", **request_)
    driven_by_hand.wait(1.0)
    assert speed_rpm(driven_by_hand) == 0.0


def test_every_line_is_named_where_one_is_not_known(machine: MachineProfile) -> None:
    said = answer(SimulatedLathe(machine), "what?")
    words = (
        "list",
        "help NAME",
        "inject",
        "active",
        "clear",
        "power-cycle",
        "spindle RPM",
        "spindle off",
        "collisions",
    )
    assert all(word in said for word in words)


def test_collisions_are_told_with_place_angle_and_time(bench: Bench, experiment: JobMaker) -> None:
    """The tip is pressed 1.5 mm into the part that stands, past 1.128 mm: the cut with its lobe and 1 mm."""
    assert answer(bench.sim, "collisions") == "ok\n"
    bench.lathe.enable()
    bench.lathe.home()
    bench.sim.mount(experiment(1))
    bench.lathe.jog_to(AxisName.CARRIAGE, 174_000.0)
    bench.lathe.jog_to(AxisName.TOOL, (76.0 - 24.5) * 5000.0)
    *lines, verdict = answer(bench.sim, "collisions").splitlines()
    assert verdict == "ok"
    form = r"(\w+): radius (\d+\.\d{3}) mm, Z 174\.000 mm, (\d+\.\d\d) deg, at (\d+\.\d) ms"
    found = [re.fullmatch(form, line) for line in lines]
    assert [match and match[1] for match in found] == ["standing_part", "too_deep"]
    first, second = (match for match in found if match)
    assert float(first[2]) == pytest.approx(25.95, abs=0.02)
    assert float(second[2]) == pytest.approx(24.8725, abs=0.02)
    assert float(first[4]) < float(second[4]) < bench.sim.now_s() * 1000.0
