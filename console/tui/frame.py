"""The six rows that never move and are never covered, as pure functions from the view to one line each."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from rich.cells import cell_len

from console.session.alarms import Alarm, Priority, foremost
from console.session.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.gate import FieldKind
from console.tui.keymap import PageName, actions_of
from console.tui.lines import Line, dim, fitted, line, ranged, width_of
from console.tui.pages.fields import named
from console.tui.theme import Token
from profiles.machine import MachineProfile
from profiles.problem import Problem

_MARKS = {Priority.HIGH: "!!!", Priority.MEDIUM: "!!", Priority.LOW: "!"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """What the rows are made of. `said` answers the last key; `clock` is local time; `now_s` machine time."""

    text: Catalogue
    state: StationState
    machine: MachineProfile
    page: PageName
    field: FieldKind
    next_step: Line
    said: tuple[Problem, ...]
    clock: datetime
    now_s: float


def state_row(frame: Frame, width: int) -> Line:
    """SIM, the machine, what it does, how old that is, and the time."""
    text, state = frame.text, frame.state
    head: list[tuple[str, Token]] = (
        [(f" {text('sim')} ", Token.SIM), ("  ", Token.TEXT)] if state.simulated else []
    )
    attention = state.activity in (Activity.STOPPED, Activity.LOST, Activity.STOPPING)
    token = Token.WARNING if attention else Token.STRONG if state.moving else Token.TEXT
    activity = text(f"activity.{state.activity}")
    if state.activity is Activity.CUTTING and state.cut is not None and state.cut.synchronisation is not None:
        activity = f"{activity} · {text(f'frame.sync.{state.cut.synchronisation}')}"
        token = Token.WARNING if state.cut.is_lost else token
    if _looks_on(state):
        held = text("frame.looks_on", holder=state.holder) if state.holder else text("frame.looks_on_free")
        activity, token = held, Token.WARNING
    left = (*head, (f"{state.machine} · ", Token.DIM), (activity, token))
    return ranged(left, (*_age(frame), dim(f"   {frame.clock:%H:%M} ")), width)


def _looks_on(state: StationState) -> bool:
    """Whether another console controls the machine, as far as that is known."""
    return not state.controls and state.activity not in (Activity.CONNECTING, Activity.LOST)


def _age(frame: Frame) -> Line:
    """How long the last look took, or how long ago it was."""
    state = frame.state
    age_s = state.age_s(frame.now_s)
    if age_s is None:
        return (dim(frame.text("frame.no_link")),)
    if state.is_stale(frame.now_s):
        return ((frame.text("frame.stale", age=f"{age_s:.0f}"), Token.WARNING),)
    return (dim(frame.text("frame.link", ms=f"{state.round_trip_ms:.0f}")),)


def alarm_row(frame: Frame, width: int) -> Line:
    """The alarm that wants attention most, with how many there are; else the answer to the last key."""
    text, alarms = frame.text, frame.state.alarms
    unseen = _unseen_alarm(frame.state)
    if unseen is not None:
        more = text("frame.acknowledge", count=len(alarms))
        return ranged(((_alarm(text, unseen), Token.ALARM),), ((f" {more} ", Token.ALARM),), width)
    answer = frame.said or frame.state.refusals
    if answer:
        more = f" +{len(answer) - 1}" if len(answer) > 1 else ""
        return line((fitted(f" – {text.problem(named(answer[0], text))}{more}", width), Token.WARNING))
    seen = foremost(alarms)
    if seen is not None:
        return line((fitted(_alarm(text, seen), width), Token.WARNING))
    return line(dim(f" · {text('frame.no_alarms')}"))


def _unseen_alarm(state: StationState) -> Alarm | None:
    """Return the foremost alarm, where nobody has seen it yet."""
    alarm = foremost(state.alarms)
    return None if alarm is None or alarm.acknowledged else alarm


def _alarm(text: Catalogue, alarm: Alarm) -> str:
    return f" {_MARKS[alarm.priority]} {text.problem(alarm.problem)}"


def pages_row(frame: Frame, width: int) -> Line:
    """The numbered pages."""
    pieces: list[tuple[str, Token]] = []
    for number, page in enumerate(PageName, start=1):
        name = f" {number} {frame.text(f'page.{page}')} "
        pieces.append((name, Token.SELECTED if page is frame.page else Token.DIM))
    spare = width - width_of(tuple(pieces))
    return (*pieces, dim(" " * max(spare, 0)))


def next_row(frame: Frame, width: int) -> Line:
    """The one obvious next thing to do; the answer to the last key where an alarm has its usual place."""
    text, state = frame.text, frame.state
    step: Line = frame.next_step
    answer = frame.said or state.refusals
    if answer and _unseen_alarm(state) is not None:
        return line((fitted(f" – {text.problem(named(answer[0], text))}", width), Token.WARNING))
    if state.activity is Activity.LOST:
        step = line((text("frame.lost"), Token.ACTION))
    elif state.activity is Activity.CONNECTING:
        step = line(dim(text("frame.connecting")))
    elif _looks_on(state) and state.stop is None:
        step = line((text("frame.observer"), Token.ACTION))
    elif state.stop is not None:
        key = "frame.recover" if state.stop.rest_s is not None else "frame.stopping"
        step = line((text(key, reason=_reason(text, state.stop.reason)), Token.ACTION))
    return ranged((((" ▶ "), Token.ACTION), *step), (), width)


def stop_row(frame: Frame, width: int) -> Line:
    """The stop key, and what a stop would and would not do now."""
    text, state = frame.text, frame.state
    key = text("frame.stop_in_text") if frame.field is FieldKind.TEXT else text("frame.stop")
    left = line((f" {key} ", Token.STOP))
    said, token = _stop_tells(text, state, frame.machine)
    # The stop key is never cut: what is said of it gives way.
    room = width - width_of(left) - 1
    return ranged(left, ((fitted(said, room) if cell_len(said) > room else said, token),), width)


def _stop_tells(text: Catalogue, state: StationState, machine: MachineProfile) -> tuple[str, Token]:
    stop = state.stop
    if stop is not None and not stop.delivered:
        return f"{text('frame.not_delivered')} ", Token.ALARM
    if state.activity is Activity.LOST:
        return f"{text('frame.not_known')} ", Token.WARNING
    if stop is not None and stop.rest_s is None:
        return f"{text('frame.stop_sent')} ", Token.WARNING
    if stop is not None and stop.rest_s is not None:
        how = text("frame.by_kill" if stop.killed else "frame.by_ramp")
        return f"{text('frame.at_rest_after', seconds=f'{stop.rest_s - stop.sent_s:.1f}', how=how)} ", Token.TEXT
    if state.activity is Activity.CUTTING and state.cut is not None and state.cut.speed_rpm is not None:
        seconds = spindle_stop_s(machine, state.cut.speed_rpm)
        return f"{text('frame.spindle_needs', seconds=f'{seconds:.1f}')} ", Token.TEXT
    if state.seen_moving:  # by another console, perhaps
        return f"{text('frame.moving')} ", Token.STRONG
    if state.snapshot is None:
        return f"{text('frame.not_known')} ", Token.DIM
    return f"{text('frame.at_rest')} ", Token.DIM


def spindle_stop_s(machine: MachineProfile, speed_rpm: float) -> float:
    """Return the time from this speed to rest at the abort rate Ix15 of the spindle motor, counts/ms2."""
    counts_per_ms = abs(speed_rpm) * machine.spindle.counts_per_rev / 60_000.0
    return counts_per_ms / machine.controller.variables[f"I{machine.spindle.motor}15"] / 1000.0


def keys_row(frame: Frame, width: int) -> Line:
    """The keys of the page, as far as they fit; all of them are on the help page."""
    pieces: list[tuple[str, Token]] = [(" ", Token.TEXT)]
    helping = [("?", Token.KEY), (f" {frame.text('key.help')}", Token.DIM)]
    room = width - 1 - width_of(tuple(helping))
    for action in actions_of(frame.page):
        written = action.shown if action.row is None else action.row
        if not written:
            continue
        fresh = [(written, Token.KEY), (f" {frame.text(f'key.{action.id}')}  ", Token.DIM)]
        room -= width_of(tuple(fresh))
        if room < 0:
            break
        pieces += fresh
    return (*pieces, *helping)


def _reason(text: Catalogue, reason: str) -> str:
    """A key is named as it is written, anything else as it is."""
    known = ("space", "escape", "f9", "f12", "unbound", "page", "screen")
    return text(f"stop_reason.{reason}") if reason in known else reason
