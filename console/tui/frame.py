"""The six rows that are never covered, as pure functions from the view to lines.

Each has one line, in a fixed place. A longer message takes further lines from the page: it is never cut.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from rich.cells import cell_len

from console.session.appearance import OwnKeys
from console.session.station.alarms import Alarm, Priority, foremost, unacknowledged_alarms
from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.application.lost_lines import is_watched, lost_step, stopping_key, unanswered_step
from console.tui.gate import FieldKind
from console.tui.key_help import written_key
from console.tui.keymap import DIGITS, FURTHER, NUMBERED, PageName, RowKey, row_keys
from console.tui.lines import (
    BLANK,
    Line,
    clip_lines,
    dim,
    hanging,
    justify_line,
    line,
    name_among,
    name_in,
    plain_text,
    width_of,
    wrap_line,
)
from console.tui.pages.fields import name_field
from console.tui.theme import Token
from drivers.lathe.console_role import BY_SSH
from drivers.lathe.snapshot import AxisName
from profiles.machine import MachineProfile
from profiles.problem import Problem

PAST = {"cut.out_of_phase": "cut.was_out_of_phase", "cut.tool_leads": "cut.tool_led"}
"""What is said of an alarm of a cut that is over: without the key that would have ended the cut."""

MARKS = {Priority.HIGH: "!!!", Priority.MEDIUM: "!!", Priority.LOW: "!"}
LEAST_BODY = 4  # lines of the page that no message takes. A longer message continues in the list of messages.
COASTING_RPM = 5.0  # above it a spindle that nothing drives is said to turn
DOT = 3  # cells of the dot behind a name
LEAST_MACHINE, LEAST_JOB = 12, 16  # cells that a name keeps while there is room for both
SHORTEST_JOB = 8  # cells below which the name of a job tells nothing
_FIRST_SERVED = ("stop", "alarm", "next")  # rows that may have several lines, in the order in which they get them


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """Input of the rows. `said` answers the last key; `clock` is local, `now_s` machine time.

    `job` is the open one, `jobs` are all saved ones: where it is shortened it looks like none of them.
    `own` are keys of the operator's own. `silent`: no alarm rings. `client` is where a terminal comes from that is
    not at this computer. `badge` is shown before everything else: what is shown is not a machine. `keys` are in
    the key row in place of those of the page.
    """

    text: Catalogue
    state: StationState
    machine: MachineProfile
    page: PageName
    field: FieldKind
    next_step: Line
    said: tuple[Problem, ...]
    clock: datetime
    now_s: float
    job: str = ""
    jobs: tuple[str, ...] = ()
    own: OwnKeys = dataclasses.field(default_factory=dict)
    badge: str = ""
    silent: bool = False
    client: str = ""
    keys: tuple[RowKey, ...] = ()


def observing(text: Catalogue, state: StationState, clock: datetime) -> str:
    """Return what an observer is told: who controls the machine, since when by the clock of this computer."""
    if not state.holder:
        return text("frame.looks_on_free")
    by = state.held_by
    if by is None:
        return text("frame.looks_on", holder=state.holder)
    since = _controls_since(by.minute, clock)
    if by.host == BY_SSH or is_address(by.host):
        return text("frame.looks_on_far", name=by.name, client=by.shown_host, since=since)
    return text("frame.looks_on_named", name=by.name, host=by.shown_host, since=since)


def is_address(host: str) -> bool:
    """Whether a signed computer is an address: that of a terminal by SSH, for computers sign their names."""
    return set(host) <= set("0123456789abcdefABCDEF:.") and ("." in host or ":" in host)


def place(text: Catalogue, state: StationState, client: str) -> Line:
    """Return where this terminal is, for a real machine that it is not at; else nothing."""
    if not client or state.simulated:
        return ()
    return ((f"{text('frame.by_ssh', client=client)}   ", Token.WARNING),)


def _controls_since(minute: int, clock: datetime) -> str:
    """Return the time of day; another day's with its date."""
    at = datetime.fromtimestamp(60 * minute, UTC).astimezone(clock.tzinfo)
    return f"{at:%H:%M}" if at.date() == clock.date() else f"{at:%Y-%m-%d %H:%M}"


def onlookers(text: Catalogue, state: StationState) -> Line:
    """Return how many look on, for the console in control; nothing where nobody does."""
    if not state.onlookers or not state.controls:
        return ()
    return (dim(f"{text('frame.onlookers', count=state.onlookers)}   "),)


def state_row(frame: Frame, width: int) -> list[Line]:
    """Return SIM, the machine, the open job, the activity, the age of the state, and the time.

    The machine is always there: which lathe this terminal is at. Where the row is full, the age of a good link
    goes first, then the middle of the job's name, the job, and who looks on; an old state is said in any case.
    """
    text, state = frame.text, frame.state
    head: list[tuple[str, Token]] = (
        [(f" {sim(text, state)} ", Token.SIM), ("  ", Token.TEXT)] if state.simulated else [(" ", Token.TEXT)]
    )
    if frame.badge:
        head = [(f" {frame.badge} ", Token.SELECTED), *head]
    attention = state.activity in (Activity.STOPPED, Activity.LOST, Activity.STOPPING)
    token = Token.WARNING if attention else Token.STRONG if state.moving else Token.TEXT
    activity = text(f"activity.{state.activity}")
    if state.paused:
        activity = text("frame.paused")
    elif state.activity is Activity.CUTTING and state.cut is not None and state.cut.synchronisation is not None:
        activity = f"{activity} · {text(f'frame.sync.{state.cut.synchronisation}')}"
        token = Token.WARNING if state.cut.is_lost else token
    if state.is_unanswered(frame.now_s):
        activity, token = text("frame.unanswered"), Token.WARNING
    if _observes(state):
        activity, token = observing(text, state, frame.clock), Token.WARNING
    clock = dim(f"   {frame.clock:%H:%M} ")
    room = width - width_of((*head, clock)) - cell_len(activity) - 1
    beside = _describe_terminal(frame, room)
    machine, job = _names(state.machine, frame, room - width_of(beside))
    names = [(f"{name} · ", token) for name, token in ((machine, Token.DIM), (job, Token.STRONG)) if name]
    return [justify_line((*head, *names, (activity, token)), (*beside, clock), width)]


def sim(text: Catalogue, state: StationState) -> str:
    """Return SIM, with what the instructor has done to its time."""
    if state.speed == 0.0:
        return text("sim.paused")
    return text("sim") if state.speed == 1.0 else text("sim.speed", speed=f"{state.speed:g}")


def _describe_terminal(frame: Frame, room: int) -> Line:
    """Return where the terminal is, who looks on and how old the state is, as far as the names leave `room`."""
    state = frame.state
    parts = [place(frame.text, state, frame.client), onlookers(frame.text, state), age_of(frame)]
    if not state.is_stale(frame.now_s) and room - sum(map(width_of, parts)) < _least_names(
        state.machine, frame.job
    ):
        parts.pop()
    for part in parts[1::-1]:
        if room - sum(map(width_of, parts)) < _least_names(state.machine, ""):
            parts.remove(part)
    return tuple(piece for part in parts for piece in part)


def _least_names(machine: str, job: str) -> int:
    """Return the cells that both names need to be well told, each with its dot."""
    named = ((machine, LEAST_MACHINE), (job, LEAST_JOB))
    return sum(min(cell_len(name), least) + DOT for name, least in named if name)


def _names(machine: str, frame: Frame, room: int) -> tuple[str, str]:
    """Return the names of the machine and of the job in `room` cells, each with its dot."""
    job = frame.job
    least = min(cell_len(machine), LEAST_MACHINE)
    for_machine = min(cell_len(machine), max(room - cell_len(job) - 2 * DOT, least))
    for_job = room - for_machine - 2 * DOT
    if not job or for_job < min(cell_len(job), SHORTEST_JOB):
        return name_in(machine, max(room - DOT, least)), ""
    return name_in(machine, for_machine), name_among(job, frame.jobs, for_job, tail_fraction=0.6)


def _observes(state: StationState) -> bool:
    return not state.controls and state.activity not in (Activity.CONNECTING, Activity.LOST)


def age_of(frame: Frame) -> Line:
    """Return how old the state is, or how fast the link answers."""
    state = frame.state
    age_s = state.age_s(frame.now_s)
    if age_s is None:
        return (dim(frame.text("frame.no_link")),)
    if state.is_stale(frame.now_s):
        return ((frame.text("frame.stale", age=f"{age_s:.0f}"), Token.WARNING),)
    return (dim(frame.text("frame.link", ms=f"{state.round_trip_ms:.0f}")),)


def alarm_row(frame: Frame, width: int) -> list[Line]:
    """Return the foremost alarm, with the number of unseen ones; else the answer to the last key."""
    text, alarms = frame.text, frame.state.alarms
    waiting, front = unacknowledged_alarms(alarms), foremost(alarms)
    more = text("frame.all") if len(alarms) > 1 else ""
    if waiting and front is not None:
        count = f"{text('frame.acknowledge', count=len(waiting))} {more}"
        return _alarm(text, front, count, Token.ALARM, width)
    if answer_of(frame):
        return _answer(frame, width)
    if front is not None:
        return _alarm(text, front, f"({len(alarms)}) {more}" if more else "", Token.WARNING, width)
    beside = line(dim(f" {text('frame.silent')} ")) if frame.silent else BLANK
    return hanging(dim(" · "), text(_quiet(frame.state)), width, Token.DIM, beside=beside)


def _quiet(state: StationState) -> str:
    """Return the text without an alarm: a machine that is not polled cannot be called well."""
    if state.snapshot is None:
        return "frame.alarms_unknown"
    axes = state.snapshot.driven_axes
    return "frame.no_alarms" if all("amplifier_enabled" in axis.flags for axis in axes) else "frame.no_alarms_off"


def answer_of(frame: Frame) -> tuple[Problem, ...]:
    """Return the answer to the last key, by the page or by the station."""
    return frame.said or frame.state.refusals


def unseen_alarm(state: StationState) -> Alarm | None:
    """Return the foremost alarm, if it is unseen."""
    return foremost(unacknowledged_alarms(state.alarms))


def _alarm(text: Catalogue, alarm: Alarm, count: str, token: Token, width: int) -> list[Line]:
    beside = line((f" {count.rstrip()} ", token)) if count else BLANK
    mark = (f" {MARKS[alarm.priority]} ", token)
    return hanging(mark, alarm_words(text, alarm), width, token, beside=beside)


def alarm_words(text: Catalogue, alarm: Alarm) -> str:
    """Return the sentence of an alarm; of one that is over and waits to be seen, that it is over."""
    if alarm.active:
        return text.problem(alarm.problem)
    past = replace(alarm.problem, code=PAST.get(alarm.problem.code, alarm.problem.code))
    return text("frame.alarm_over", problem=text.problem(past))


def _answer(frame: Frame, width: int) -> list[Line]:
    """Return the first answer in full, and how many more the list of messages shows."""
    text, (first, *others) = frame.text, answer_of(frame)
    beside = line((f" +{len(others)} {text('frame.all')} ", Token.WARNING)) if others else BLANK
    return hanging(
        (" – ", Token.WARNING), text.problem(name_field(first, text)), width, Token.WARNING, beside=beside
    )


def pages_row(frame: Frame, width: int) -> list[Line]:
    """Return the pages, the closer together the less room there is. A page without a digit is shown as More is."""
    last = frame.page if frame.page in FURTHER else PageName.MORE
    shown = {**{page: DIGITS[page] for page in NUMBERED}, last: DIGITS[PageName.MORE]}
    if frame.page is PageName.TRAIN:
        shown |= {PageName.TRAIN: "9", PageName.MORE: DIGITS[PageName.MORE]}
    rows = [_pages(frame, shown, *room) for room in ((" ", " "), ("", " "), ("", ""))]
    return [justify_line(next((row for row in rows if width_of(row) <= width), rows[-1]), BLANK, width)]


def _pages(frame: Frame, shown: dict[PageName, str], around: str, between: str) -> Line:
    """Return the pages with this much room around each, and between its digit and its name."""
    pieces: list[tuple[str, Token]] = []
    for page, digit in shown.items():
        token = Token.SELECTED if page is frame.page else Token.DIM
        pieces += [
            dim("" if around else " "),
            (f"{around}{digit}{between}{frame.text(f'page.{page}')}{around}", token),
        ]
    return tuple(pieces)


def next_row(frame: Frame, width: int) -> list[Line]:
    """Return the next thing to do; the answer to the last key where an alarm has its usual place."""
    text, state = frame.text, frame.state
    step: Line = frame.next_step
    if answer_of(frame) and unseen_alarm(state) is not None:
        return _answer(frame, width)
    if state.speed == 0.0:
        step = line((text("frame.instructor_paused"), Token.ACTION))
    elif unanswered := unanswered_step(text, state, frame.now_s):
        step = line((unanswered, Token.ACTION))
    elif lost := lost_step(text, state):
        step = line((lost, Token.ACTION))
    elif state.activity is Activity.CONNECTING:
        step = line(dim(text("frame.connecting", address=state.address)))
    elif _observes(state) and state.stop is None:
        step = line((text("frame.observer"), Token.ACTION))
    elif state.stop is not None:
        key = "frame.recover" if state.stop.rest_s is not None else stopping_key(state)
        step = line((text(key, reason=text.reason(state.stop.reason)), Token.ACTION))
    token = step[0][1] if step else Token.TEXT
    return hanging((" ▶ ", Token.ACTION), plain_text([step]), width, token)


def stop_row(frame: Frame, width: int) -> list[Line]:
    """Return the stop key, and what a stop would and would not do now; the key is in the last line."""
    text, state = frame.text, frame.state
    key = text("frame.stop_in_text" if frame.field is FieldKind.TEXT else "frame.stop")
    left = line((f" {key} ", Token.STOP))
    words, token = _of_stop(text, state, frame.machine)
    if state.is_unanswered(frame.now_s) and (state.stop is None or state.stop.delivered):
        words, token = text("frame.not_known"), Token.WARNING
    rows = wrap_line(words, max(width - width_of(left) - 2, 1), token)
    column = max(width_of(row) for row in rows) + 1
    filled = [(*row, dim(" " * (column - width_of(row)))) for row in rows]
    return [*(justify_line(BLANK, row, width) for row in filled[:-1]), justify_line(left, filled[-1], width)]


def _is_stopping(state: StationState) -> bool:
    return state.stop is not None and state.stop.rest_s is None


def _spindle_turns(state: StationState) -> bool:
    return state.spindle_rpm is not None and abs(state.spindle_rpm) >= COASTING_RPM


def _cut_rpm(state: StationState) -> float | None:
    """Return the speed of the spindle in the present cut; None without one."""
    return state.cut.speed_rpm if state.activity is Activity.CUTTING and state.cut is not None else None


_STOP_WORDS: tuple[tuple[str, Token, Callable[[StationState], bool]], ...] = (
    ("frame.stop_waits", Token.WARNING, lambda s: s.stop_waits),
    ("lost_link.not_delivered", Token.WARNING, is_watched),
    ("frame.not_delivered", Token.ALARM, lambda s: s.stop is not None and not s.stop.delivered),
    ("frame.not_known", Token.WARNING, lambda s: s.activity is Activity.LOST),
    (
        "frame.stop_turns",
        Token.WARNING,
        lambda s: _is_stopping(s) and s.stop is not None and s.stop.taken_s is not None and _spindle_turns(s),
    ),
    ("frame.stop_sent", Token.WARNING, _is_stopping),
    ("frame.at_rest_after", Token.TEXT, lambda s: s.stop is not None and s.stop.still_s is None),
    ("frame.at_rest_seen", Token.TEXT, lambda s: s.stop is not None),
    ("frame.spindle_needs", Token.TEXT, lambda s: _cut_rpm(s) is not None),
    ("frame.moving", Token.STRONG, lambda s: s.seen_moving),  # possibly by another console
    ("frame.not_known", Token.DIM, lambda s: s.snapshot is None),
    ("frame.spindle_turns", Token.WARNING, _spindle_turns),
    ("frame.at_rest", Token.DIM, lambda s: True),
)
"""What the stop row says: the first of these that applies."""


def _of_stop(text: Catalogue, state: StationState, machine: MachineProfile) -> tuple[str, Token]:
    key, token = next((key, token) for key, token, applies in _STOP_WORDS if applies(state))
    stop, cut_rpm, facts = state.stop, _cut_rpm(state), {"speed": f"{state.spindle_rpm or 0.0:.0f}"}
    if stop is not None and stop.rest_s is not None:
        seen_s = stop.rest_s if stop.still_s is None else stop.still_s
        facts |= {"seconds": f"{seen_s - stop.sent_s:.1f}", "proven": f"{stop.rest_s - stop.sent_s:.1f}"}
        facts["how"] = text("frame.by_kill" if stop.killed else "frame.by_ramp")
    elif cut_rpm is not None:
        facts["seconds"] = f"{spindle_stop_s(machine, cut_rpm):.1f}"
    return text(key, **facts), token


def spindle_stop_s(machine: MachineProfile, speed_rpm: float) -> float:
    """Return the time from this speed to rest after a stop, s; a revolution a minute is 6 degrees a second."""
    from drivers.lathe.lengths import settings_of  # not for the first paint: the link thread has it by then

    return settings_of(machine, AxisName.SPINDLE).stop_s(6.0 * abs(speed_rpm))


def keys_row(frame: Frame, width: int) -> list[Line]:
    """Return the keys of the page, as far as they fit; all of them are on the help page."""
    pieces: list[tuple[str, Token]] = [(" ", Token.TEXT)]
    helping = [("?", Token.KEY), (f" {frame.text('key.help')}", Token.DIM)]
    room = width - 1 - width_of(tuple(helping))
    for key in frame.keys or row_keys(frame.page):
        written = key.shown
        if (mine := frame.own.get(key.action)) is not None:
            written = f"{written_key(mine)} {key.shown if key.doubled else ''}".rstrip()
        fresh = [(written, Token.KEY), (f" {frame.text(key.words)}  ", Token.DIM)]
        room -= width_of(tuple(fresh))
        if room < 0:
            break
        pieces += fresh
    return [(*pieces, *helping)]


ROWS: dict[str, Callable[[Frame, int], list[Line]]] = {
    "state": state_row,
    "alarm": alarm_row,
    "pages": pages_row,
    "next": next_row,
    "stop": stop_row,
    "keys": keys_row,
}


def frame_rows(frame: Frame, width: int, height: int) -> dict[str, list[Line]]:
    """Return the lines of each row for this terminal size; stop and keys are the last lines."""
    rows = {name: row(frame, width) for name, row in ROWS.items()}
    spare = max(height - len(rows) - LEAST_BODY, 0)
    for name in _FIRST_SERVED:
        lines = rows[name]
        # The key of the stop row is in its last line.
        rows[name] = (
            lines[-1 - spare :] if name == "stop" else clip_lines(lines, 1 + spare, frame.text("panel.more"))
        )
        spare -= len(rows[name]) - 1
    return rows


def small_rows(text: Catalogue, state: StationState, smallest: tuple[int, int], width: int) -> list[Line]:
    """Return the required size; before it what cannot wait: a stop that failed, an alarm."""
    title = text("small.title") if state.simulated else text("small.real")
    rows = [line((f" {title} ", Token.SIM if state.simulated else Token.STRONG))]
    if state.speed != 1.0:
        rows.append(line((f" {sim(text, state)} ", Token.SIM)))
    if state.stop is not None and not state.stop.delivered:
        rows += wrap_line(f"!!! {text('frame.not_delivered')}", width, Token.ALARM)
    alarm = unseen_alarm(state)
    if alarm is not None:
        rows += wrap_line(f"{MARKS[alarm.priority]} {alarm_words(text, alarm)}", width, Token.ALARM)
    return [*rows, *wrap_line(text("small.say", columns=smallest[0], rows=smallest[1]), width)]
