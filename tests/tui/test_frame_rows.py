"""The rows that never move: what they say, and that they fit."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from itertools import product
from pathlib import Path

import pytest

import console
from console.session.station.alarms import (
    Priority,
    acknowledge_alarms,
    acknowledge_shown_alarms,
    clear_alarms,
    collision_problems,
    raise_alarm,
)
from console.session.station.progress import Synchronisation
from console.session.station.state import Activity, StationState, StopState
from console.text.catalogue import load
from console.tui.frame import (
    ROWS,
    Frame,
    alarm_row,
    keys_row,
    next_row,
    pages_row,
    small_rows,
    spindle_stop_s,
    state_row,
    stop_row,
)
from console.tui.gate import FieldKind
from console.tui.key_help import LISTS, help_lines
from console.tui.keymap import ACTIONS, PageName, actions_of
from console.tui.lines import Line, line, plain_text, width_of
from console.tui.list_panel import message_lines
from console.tui.theme import COLOUR, Token
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.snapshot import FAULT_FLAGS, AxisName, AxisState, Snapshot
from drivers.simulator.plant.workshop_view import CollisionKind
from profiles.machine import SAFETY_DEVICES
from profiles.problem import Problem
from profiles.store import load_machine
from tests.tui.run_stage import cutting
from tests.tui.stage import LANGUAGES

MACHINE = load_machine("lee-2001-lathe").machine
REST = frozenset({"amplifier_enabled", "desired_velocity_zero", "in_position", "home_complete"})
AXIS = AxisState(position=0.0, following_error=0.0, flags=REST)
LOOK = Snapshot(
    asked_s=10.0, at_s=10.0, tool=AXIS, spindle=AXIS, carriage=AXIS, program_running=False, runtime_error=False
)
READY = StationState(activity=Activity.READY, machine="lee-2001-lathe", snapshot=LOOK, round_trip_ms=5.0)
STOPPED = replace(
    READY,
    activity=Activity.STOPPED,
    stop=StopState(reason="space", killed=False, sent_s=10.0, rest_s=10.6, tool_in_part=True, can_retract=True),
)
ALARM = replace(READY, alarms=raise_alarm((), Problem(code="machine.fault", value="tool"), Priority.HIGH, 1.0))


def frame(state: StationState = READY, language: str = "en", **changes: object) -> Frame:
    made = Frame(
        text=load(language),
        state=state,
        machine=MACHINE,
        page=PageName.RUN,
        field=FieldKind.NONE,
        next_step=line("what to do"),
        said=(),
        clock=datetime(2026, 1, 2, 8, 41),
        now_s=10.1,
    )
    return replace(made, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("width", [60, 80, 100, 160])
@pytest.mark.parametrize("state", [StationState(), READY, STOPPED, ALARM], ids=["first", "ready", "stop", "alarm"])
def test_no_row_is_wider_than_the_terminal(state: StationState, width: int, language: str) -> None:
    for page in PageName:
        for name, row in ROWS.items():
            lines = row(frame(state, language, page=page), width)
            assert lines and all(width_of(each) <= width for each in lines), name


@pytest.mark.parametrize("language", ["en", "ko"])
def test_the_key_row_of_scope_names_what_opens_a_kept_record(language: str) -> None:
    words = load(language)("key.scope.list")
    assert f"o {words} " in plain_text(keys_row(frame(language=language, page=PageName.SCOPE), 80))


COASTS = replace(READY, spindle_rpm=-532.2)
"""A disabled spindle is at rest for its controller: no velocity is commanded."""
SENT = replace(STOPPED, activity=Activity.STOPPING, stop=StopState(reason="f9", killed=True, sent_s=10.0))


@pytest.mark.parametrize(
    ("row", "now", "words", "without"),
    [
        (state_row, frame(), "link ≤ 5 ms", ""),
        (state_row, frame(now_s=13.0), "STALE, 3 s", ""),
        (state_row, frame(replace(READY, simulated=False)), "", "SIM"),
        (next_row, frame(STOPPED), "F2", ""),
        (stop_row, frame(STOPPED), "0.6 s", ""),
        (stop_row, frame(SENT), "not yet at rest", ""),
        (stop_row, frame(), "SPACE", ""),
        (stop_row, frame(field=FieldKind.TEXT), "F12", ""),
        (stop_row, frame(replace(READY, spindle_rpm=0.4)), "at standstill", ""),
        (stop_row, frame(COASTS), "spindle turning -532 rpm", "standstill"),
        # A page without a digit has the place of the page that lists it.
        (pages_row, frame(page=PageName.SETTINGS), "8 Alarms 0 Settings", ""),
        (pages_row, frame(page=PageName.ALARMS), "8 Alarms 0 More", ""),
    ],
)
def test_a_row_says_what_is_the_case(row: Callable[..., list[Line]], now: Frame, words: str, without: str) -> None:
    shown = plain_text(row(now, 80))
    assert words in shown and (not without or without not in shown)


def test_sim_is_the_first_word_on_the_screen() -> None:
    assert plain_text(state_row(frame(), 80)).startswith(" SIM ")


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize(("speed", "shown"), [(0.0, r"SIM (paused|멈춤)"), (2.0, "SIM x2"), (0.25, r"SIM x0\.25")])
def test_the_time_of_an_instructor_is_beside_sim(speed: float, shown: str, language: str) -> None:
    state = replace(READY, speed=speed)
    assert re.match(f" {shown} ", plain_text(state_row(frame(state, language, job="a job with a long name"), 80)))
    assert re.search(shown, plain_text(small_rows(load(language), state, (60, 20), 60)))
    paused = load(language)("frame.instructor_paused")
    assert (paused in plain_text(next_row(frame(state, language), 80))) is (speed == 0.0)
    waits = replace(state, stop_waits=True)
    assert load(language)("frame.stop_waits") in plain_text(stop_row(frame(waits, language), 80))


@pytest.mark.parametrize("language", ["en", "ko"])
def test_the_open_job_is_in_the_first_row_and_two_jobs_alike_differ(language: str) -> None:
    """At 80 columns, in every activity, whether the machine is simulated or not; the middle is shortened."""
    for activity in Activity:
        state = replace(READY, activity=activity)
        if activity is Activity.CUTTING:
            state = cutting(synchronisation=Synchronisation.LOST)
        first, second = (
            plain_text(state_row(frame(state, language, job=f"lee-2001-experiment-{number}"), 80))
            for number in (1, 2)
        )
        assert first != second and "lee-" in first, activity
        assert load(language)(f"activity.{activity}") in first and "ent-1 · " in first, first


FULL: tuple[dict[str, object], ...] = (
    {},
    {"standing": ConsoleRole.OBSERVER, "holder": 0},
    {"standing": ConsoleRole.OBSERVER, "holder": 1_683_503_496},
    {"onlookers": 2, "activity": Activity.LOST},
)


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("client", ["", "192.168.100.107"])
@pytest.mark.parametrize("full", FULL, ids=["ready", "free", "held", "lost"])
def test_which_lathe_it_is_can_always_be_read(full: dict[str, object], client: str, language: str) -> None:
    """At 80 columns, on a real lathe, whatever else the row has to tell, and however slow the link is."""
    for trip_ms, job in product((5.0, 20.0, 250.0), ("", "ring3 링", "lee-2001-experiment-1")):
        for name, shown in (("big-lathe", "big"), ("ring3 선반 (2호기)", "rin")):
            state = replace(READY, machine=name, simulated=False, round_trip_ms=trip_ms, **full)  # type: ignore[arg-type]
            row = plain_text(state_row(frame(state, language, job=job, client=client), 80))
            assert load(language)("activity.lost") in row or state.activity is not Activity.LOST
            assert row.strip().startswith(shown) and name[-1] in row.partition(" · ")[0], row
            assert width_of(state_row(frame(state, language, job=job, client=client), 80)[0]) <= 80


def test_the_age_of_a_good_link_gives_way_before_a_name_and_that_of_an_old_state_never() -> None:
    free = replace(READY, simulated=False, machine="lathe-7", standing=ConsoleRole.OBSERVER, holder=0)
    slow = plain_text(state_row(frame(replace(free, round_trip_ms=20.0), job="ring3 링"), 80))
    assert "lathe-7 · ring3 링 · OBSERVING, no console has control" in slow
    full = plain_text(state_row(frame(free, job="lee-2001-experiment-1"), 80))
    assert "lathe-7 · " in full and "ent-1 · OBSERVING" in full and "link" not in full
    old = plain_text(state_row(frame(free, job="lee-2001-experiment-1", now_s=13.0), 80))
    assert "lathe-7 · " in old and "STALE, 3 s" in old


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("together", Synchronisation)
def test_in_a_cut_the_first_row_tells_how_tool_and_spindle_are_together(
    together: Synchronisation, language: str
) -> None:
    (row,) = state_row(frame(cutting(synchronisation=together), language), 80)
    words = load(language)(f"frame.sync.{together}")
    (token,) = (token for piece, token in row if piece.endswith(f" · {words}"))
    assert (token is Token.WARNING) == (together is Synchronisation.LOST)
    nothing = plain_text(state_row(frame(cutting(synchronisation=None)), 80))
    assert "CUTTING  " in nothing


def test_an_alarm_stays_before_everything_else_until_it_was_seen() -> None:
    refused = (Problem(code="screen.moving"),)
    assert "!!!" in plain_text(alarm_row(frame(ALARM, said=refused), 80))
    seen = replace(ALARM, alarms=acknowledge_alarms(ALARM.alarms))
    assert "the machine is moving" in plain_text(alarm_row(frame(seen, said=refused), 80))
    assert "!!!" in plain_text(alarm_row(frame(seen), 80))


@pytest.mark.parametrize(("language", "word"), [("en", "over: "), ("ko", "해제됨: ")])
def test_an_alarm_that_is_over_and_waits_to_be_seen_says_that_it_is_over(language: str, word: str) -> None:
    over = replace(ALARM, alarms=tuple(replace(each, active=False) for each in ALARM.alarms))
    for state, said in ((ALARM, False), (over, True)):
        shown = frame(state, language)
        rows = (
            alarm_row(shown, 80),
            message_lines(shown, (), 80),
            small_rows(load(language), state, (80, 24), 60),
        )
        assert [word in plain_text(each) for each in rows] == [said] * 3


@pytest.mark.parametrize(("language", "name"), [("en", "force, total"), ("ko", "척킹력, 합계")])
def test_an_answer_names_a_value_as_set_up_does(language: str, name: str) -> None:
    refused = (Problem(code="rule.force_differs", key="chucking_force_n", value="1400 N", limit="1314 N"),)
    for shown in (
        alarm_row(frame(language=language, said=refused), 80),
        alarm_row(frame(replace(READY, refusals=refused), language), 80),
        next_row(frame(ALARM, language, said=refused), 80),
    ):
        assert f"{name} = 1400 N" in plain_text(shown)


def test_the_spindle_needs_its_speed_over_the_abort_rate() -> None:
    """1000 rpm of 10000 counts are 166.7 counts/ms; at 0.5 counts/ms2 that is a third of a second."""
    assert spindle_stop_s(MACHINE, 1000.0) == pytest.approx(0.3333, abs=1e-3)


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("page", PageName)
def test_all_keys_of_a_page_stand_in_its_key_row(page: PageName, language: str) -> None:
    row = plain_text(keys_row(frame(language=language, page=page), 80))
    missing = [a.id for a in actions_of(page) if a.row != "" and (a.row or a.shown) not in row]
    assert missing == [] and "key." not in row


@pytest.mark.parametrize("language", ["en", "ko"])
def test_the_help_names_every_key_and_fits_a_page(language: str) -> None:
    for page in PageName:
        for number in range(1, LISTS + 1):
            rows = help_lines(load(language), page, number, 78)
            assert all(width_of(row) <= 78 for row in rows), page
        assert all(a.shown in plain_text(help_lines(load(language), page, 1, 78)) for a in actions_of(page))


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("width", [80, 160])
@pytest.mark.parametrize("kind", CollisionKind)
def test_what_the_tool_ran_into_is_said_in_full(kind: CollisionKind, width: int, language: str) -> None:
    """Beside two that were seen: what to press stands next to it, and how many nobody has seen."""
    (problem,) = collision_problems((kind,))
    alarms = raise_alarm(ALARM.alarms, Problem(code="link.lost"), Priority.HIGH, 2.0)
    alarms = raise_alarm(acknowledge_alarms(alarms), problem, Priority.HIGH, 3.0)
    rows = alarm_row(frame(replace(READY, alarms=alarms), language), width)
    assert width_of(rows[0]) == width
    count = f"{load(language)('frame.acknowledge', count=1)} {load(language)('frame.all')}"
    assert count in plain_text(rows[:1])
    assert plain_text(rows).replace(count, "").split() == f"!!! {load(language).problem(problem)}".split()


@pytest.mark.parametrize("language", ["en", "ko"])
def test_the_number_of_alarms_is_that_of_those_that_come_to_the_row(language: str) -> None:
    """A fault that was seen, and still stands; another alarm that is new."""
    alarms = raise_alarm(acknowledge_alarms(ALARM.alarms), Problem(code="link.lost"), Priority.HIGH, 2.0)
    for count in (1, 0):
        row = plain_text(alarm_row(frame(replace(READY, alarms=alarms), language), 80))
        assert (load(language)("frame.acknowledge", count=count) in row) is (count > 0)
        alarms = acknowledge_shown_alarms(alarms)
    assert "!!!" in row, "what stands is still shown"


DOING = ("poll", "rest", "program", "home tool", "jog carriage", "arm", "identify")
"""In what a fault is met, as the code has it."""


@pytest.mark.parametrize("language", ["en", "ko"])
def test_no_fault_shows_its_identifier(language: str) -> None:
    for axis, flag, doing in product(AxisName, FAULT_FLAGS, DOING):
        problem = Problem(code="machine.fault", key=doing, value=f"{axis}: {flag}")
        alarms = raise_alarm((), problem, Priority.HIGH, 1.0)
        row = plain_text(alarm_row(frame(replace(READY, alarms=alarms), language), 160))
        assert "_" not in row and f"during {doing}:" not in row, row
        if language == "ko":
            assert not re.search(r"[a-z]{3}", row.partition("k ")[0]), row
        elif (axis, flag) == (AxisName.TOOL, "amplifier_fault"):
            assert "tool: amplifier fault" in row


REASONS = (
    *(f"{axis}: {flag}" for axis in AxisName for flag in FAULT_FLAGS),
    *(f"{what} {axis}{after}" for what in ("home", "jog") for axis in AxisName for after in ("", ": 60 s")),
    *(f"safety.{device}" for device in SAFETY_DEVICES),
    *("program: 20 s", "fault", "machine.fault", "machine.timeout", "heartbeat.plc_silent", "link.silent"),
    *("owner.ousted", "cut.out_of_phase", "record.lost", "session.fault"),
)
"""For what the machine is stopped, besides keys and signals."""


@pytest.mark.parametrize("language", ["en", "ko"])
def test_no_stop_shows_the_identifier_of_its_reason(language: str) -> None:
    for reason in REASONS:
        stopped = replace(STOPPED, stop=replace(STOPPED.stop, reason=reason))  # type: ignore[type-var]
        row = plain_text(next_row(frame(stopped, language), 160))
        said = load(language).problem(Problem(code="machine.stopped", value=reason))
        for words in (row, said):
            assert not re.search(r"\w_\w|[a-z]\.[a-z]", words), words
        if language == "ko":
            assert not re.search(r"[a-z]{2}", said), said


@pytest.mark.parametrize("language", ["en", "ko"])
def test_no_alarm_is_not_said_of_what_nobody_looks_at(language: str) -> None:
    """A controller looks at limit switches and amplifiers only while the drives are on."""
    text = load(language)

    def rows(snapshot: Snapshot | None, width: int = 80) -> list[str]:
        lines = alarm_row(frame(replace(READY, snapshot=snapshot), language), width)
        assert all(width_of(each) <= width for each in lines)
        return [plain_text([each]) for each in lines]

    axis = replace(AXIS, flags=REST - {"amplifier_enabled"})
    disabled = replace(LOOK, tool=axis, spindle=axis, carriage=axis)
    shown = {"frame.no_alarms": LOOK, "frame.no_alarms_off": disabled, "frame.alarms_unknown": None}
    for key, snapshot in shown.items():
        assert rows(snapshot) == [f" · {text(key)}"], "one row at 80 columns, and all of it"
        assert "".join("".join(rows(snapshot, 60)).split()) == f"·{text(key)}".replace(" ", "")


@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_motion_of_which_nothing_is_heard_is_not_said_to_go_on(language: str) -> None:
    """Two polls have not been answered then, and the controller has begun to end the motion by itself."""
    words, cut = load(language), cutting()
    assert cut.snapshot is not None
    known, silent = (frame(cut, language, now_s=cut.snapshot.asked_s + late_s) for late_s in (0.4, 0.7))
    assert words("activity.cutting") in plain_text(state_row(known, 120))
    assert words("frame.unanswered") in plain_text(state_row(silent, 120))
    assert words("activity.cutting") not in plain_text(state_row(silent, 120))
    assert words("frame.no_answer", age="0.7") in plain_text(next_row(silent, 120))
    assert words("frame.not_known") in plain_text(stop_row(silent, 120))


@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_link_that_was_lost_before_does_not_end_the_hope_for_one_that_is_silent_now(language: str) -> None:
    words, stop = load(language), StopState(reason="link.silent", killed=True, sent_s=9.0)
    lost = raise_alarm((), Problem(code="link.lost", value="closed"), Priority.HIGH, 1.0)
    silent = replace(READY, activity=Activity.LOST, stop=stop, alarms=(replace(lost[0], active=False),))
    assert words("lost_link.silent") in plain_text(next_row(frame(silent, language), 200))
    gone = replace(silent, alarms=lost)
    assert words("frame.lost") in plain_text(next_row(frame(gone, language), 200))


@pytest.mark.parametrize("language", ["en", "ko"])
def test_once_it_answers_a_stop_of_a_silent_machine_is_said_to_be_proven_and_a_coasting_spindle_to_coast(
    language: str,
) -> None:
    words = load(language)
    stop = StopState(reason="link.not_in_step", killed=True, sent_s=9.0, taken_s=10.0)
    answers = frame(replace(READY, activity=Activity.STOPPING, stop=stop, spindle_rpm=412.0), language)
    assert words("frame.stopping_again") in plain_text(next_row(answers, 120))
    assert words("frame.stop_turns", speed="412") in plain_text(stop_row(answers, 120))
    again = replace(answers, now_s=12.0)
    assert words("lost_link.silent") in plain_text(next_row(again, 200)), "it has fallen silent again"


@pytest.mark.parametrize("language", ["en", "ko"])
def test_an_alarm_of_a_cut_that_is_over_asks_for_no_key_that_would_have_ended_it(language: str) -> None:
    out = Problem(code="cut.out_of_phase", limit="± 1.4 deg")
    over = replace(STOPPED, alarms=clear_alarms(raise_alarm((), out, Priority.MEDIUM, 1.0), out.code))
    row = plain_text(alarm_row(frame(over, language), 300))
    assert "F7" not in row and "± 1.4 deg" in row
    standing = replace(STOPPED, alarms=raise_alarm((), out, Priority.MEDIUM, 1.0))
    assert "F7" in plain_text(alarm_row(frame(standing, language), 300))


# Rules of the frame that no page may break: the name of the stop, nothing flashes, the word SIM, one key.


TUI = Path(console.__file__).parent / "tui"


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_stop_key_is_no_emergency_stop(language: str) -> None:
    """Rules S1 and S2: it is called STOP MOTION, and is neither red nor yellow."""
    text = load(language)
    for field, key in ((FieldKind.NONE, "frame.stop"), (FieldKind.TEXT, "frame.stop_in_text")):
        shown = text(key)
        assert ("STOP MOTION" if language == "en" else "정지") in shown
        assert not {"emergency", "비상", "e-stop"} & set(shown.casefold().split())
        row = ROWS["stop"](replace(frame(language=language), field=field), 80)[-1]
        assert row[0][0].strip() == shown and row[0][1] is Token.STOP
    background = COLOUR[Token.STOP].bgcolor
    assert background is not None and background.triplet is not None
    assert max(background.triplet) - min(background.triplet) < 32, "a grey"


def test_nothing_flashes() -> None:
    """Rule C4."""
    lines = [line for path in TUI.rglob("*.py") for line in path.read_text(encoding="utf-8").splitlines()]
    assert {line.strip().rpartition(".")[2] for line in lines if "blink" in line} == {"cursor_blink = False"}


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("page", PageName)
def test_a_simulation_is_called_one_in_the_first_row(page: PageName, language: str) -> None:
    """Rule X1."""
    shown = frame(language=language)
    for simulated in (True, False):
        now = replace(shown, page=page, state=replace(shown.state, simulated=simulated))
        assert (load(language)("sim") in plain_text(ROWS["state"](now, 80)).split()) is simulated


def test_every_action_has_a_single_key() -> None:
    """Rule L1: a chord exists only beside a single key, and to leave."""
    chords = [
        action.id for action in ACTIONS if action.keys and all("+" in key and len(key) > 1 for key in action.keys)
    ]
    assert chords == ["quit"]
