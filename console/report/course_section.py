"""Section on the cut: tool and spindle over the turns, its end, alarms, actions of the operator."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from console.report.course_figure import course_figure
from console.report.drawing import figure
from console.report.markup import Markup, element, paragraph, section, table
from console.report.quantities import number, time_in, um
from console.session.data.run_rows import PROBLEMS, REASONS, recorded_problems
from console.session.data.run_story import (
    ACKNOWLEDGED,
    ENDED,
    POLLED,
    RAISED,
    TELEMETRY_END,
    AlarmStory,
    RecordedTelemetry,
    RunEvent,
)
from console.session.learning.opened_run import OpenedRun
from console.text.catalogue import Catalogue
from console.text.recorded_words import Layout, ending_words, order_words, part_words, problem_words
from profiles.arrays import Floats

NOT_LISTED = frozenset({RAISED, ACKNOWLEDGED, ENDED, TELEMETRY_END})
NOT_PLAIN = frozenset({"command", REASONS, PROBLEMS})
MOST_DETAIL = 160
LEAST_ROWS = 2
FIGURES = ("tool_error_um", "tool_error_rms_um", "following_error_um", "following_error_rms_um")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InPart:
    """Telemetry of a cut while the tool was fed along the part; M samples, shape (M,) each."""

    part: str
    turn: Floats
    tool_error_um: Floats
    speed_rpm: Floats


def write_course(run: OpenedRun, text: Catalogue) -> Markup:
    """Write the section."""
    cuts = [found for each in run.story.telemetry if (found := _in_part(each, run)) is not None]
    last = cuts[-1] if cuts else None
    ended = ending_words(run.story.row.ended, text, Layout.REPORT)
    return section(
        "course",
        text("report.course"),
        paragraph(element("strong", text("report.ended")), " ", ended),
        _recorded_figures(run, text),
        paragraph(text("report.no_telemetry")) if last is None else _draw_cut(run, last, text),
        _describe_gathered_data(run, text),
        _alarms(run, text),
        _events(run, text),
    )


def _in_part(telemetry: RecordedTelemetry, run: OpenedRun) -> InPart | None:
    """Return the samples while the tool was fed along the part: before and after it is far from its path."""
    if telemetry.kind != POLLED:
        return None
    value = {name: telemetry.column(name).astype(np.float64) for name in ("turn", "tool_error_um", "speed_rpm")}
    over = telemetry.fed_along(np.inf if run.job is None else run.job.cut_length_mm)
    for each in value.values():
        over &= np.isfinite(each)
    if over.sum() < LEAST_ROWS:
        return None
    return InPart(part=telemetry.part, **{name: each[over] for name, each in value.items()})


def _draw_cut(run: OpenedRun, cut: InPart, text: Catalogue) -> Markup:
    name, turns = part_words(cut.part or "part", text), text("report.turns")
    error, speed = cut.tool_error_um, cut.speed_rpm
    facts = {"part": name, "count": error.size}
    low, high = number(error.min(), 1), number(error.max(), 1)
    rms = number(float(np.sqrt(np.mean(error**2))), 1)
    error_caption = text("report.error_caption", low=low, high=high, rms=rms, **facts)
    nominal = float(np.median(speed)) if run.job is None else run.job.spindle_speed_rpm
    low, high, mean = (number(float(each), 2) for each in (speed.min(), speed.max(), speed.mean()))
    speed_caption = text("report.speed_caption", low=low, high=high, mean=mean, nominal=f"{nominal:g}", **facts)
    drawings = (
        course_figure(
            "tool-error",
            text("report.error_plot"),
            error_caption,
            (turns, text("report.error_axis")),
            cut.turn,
            error,
            nominal=0.0,
            least_reach=1.0,
            joined=False,
        ),
        course_figure(
            "spindle-speed",
            text("report.speed_plot"),
            speed_caption,
            (turns, text("report.speed_axis")),
            cut.turn,
            speed,
            nominal=nominal,
            least_reach=0.001 * nominal,
            joined=True,
        ),
    )
    captions = (error_caption, speed_caption)
    return element("div", *(figure(each, words) for each, words in zip(drawings, captions, strict=True)))


def _recorded_figures(run: OpenedRun, text: Catalogue) -> Markup | None:
    """Return the tool errors as judged at the end of the cut."""
    found = [event.data for event in run.story.events if event.kind in ("result", "cut", "held")]
    if not found:
        return None
    said = [text(f"report.recorded.{key}", value=um(found[-1][key])) for key in FIGURES if key in found[-1]]
    return paragraph(text("report.recorded_figures", figures="; ".join(said))) if said else None


def _describe_gathered_data(run: OpenedRun, text: Catalogue) -> Markup | None:
    windows = [each for each in run.story.telemetry if each.kind != POLLED]
    if not windows:
        return None
    return paragraph(text("report.gathered", count=sum(len(each.rows) for each in windows)))


def _alarms(run: OpenedRun, text: Catalogue) -> Markup:
    alarms = run.story.alarms
    if not alarms:
        return paragraph(text("report.no_alarms"))
    head = [text("alarms_page.time"), text("report.alarm_what"), text("report.alarm_after")]
    rows = [
        [
            _time(run, alarm.raised),
            f"{_priority(alarm, text)}: {text.problem(alarm.problem)}",
            _describe_alarm_end(run, alarm, text),
        ]
        for alarm in alarms
    ]
    return table(text("records.alarms"), head, rows, style="events")


def _priority(alarm: AlarmStory, text: Catalogue) -> str:
    return _name_or_code("report.priority", alarm.priority, text)


def _describe_alarm_end(run: OpenedRun, alarm: AlarmStory, text: Catalogue) -> str:
    """Return when an alarm was acknowledged, and when it cleared."""
    said = []
    if alarm.acknowledged is not None:
        said.append(text("alarms_page.acknowledged", at=_time(run, alarm.acknowledged)))
    if alarm.ended is not None:
        said.append(text("alarms_page.ended", at=_time(run, alarm.ended)))
    return ", ".join(said) or text("report.alarm_open")


def _time(run: OpenedRun, at: datetime) -> str:
    return time_in(run.zone, at, run.story.row.started)


def _events(run: OpenedRun, text: Catalogue) -> Markup | None:
    events = [event for event in run.story.events if event.kind not in NOT_LISTED]
    if not events:
        return None
    rows = [[_time(run, event.at), _name(event, text), _detail(event, text)] for event in events]
    head = [text("fact.time"), text("report.what"), text("report.detail")]
    return table(text("report.events"), head, rows, style="events")


def _name(event: RunEvent, text: Catalogue) -> str:
    """Return an event in words; an unknown kind by its name in the record."""
    data = event.data
    if event.kind == "step":
        part, step = part_words(str(data.get("part") or "part"), text), str(data.get("step", ""))
        return f"{part}: {_name_or_code('step', step, text)}"
    if event.kind == "command":
        return order_words(str(data.get("command", "")), text)
    return _name_or_code("report.event", event.kind, text)


def _name_or_code(family: str, name: str, text: Catalogue) -> str:
    said = text(f"{family}.{name}")
    return name if said == f"{family}.{name}" else said


def _detail(event: RunEvent, text: Catalogue) -> str:
    """Return the plain values of an event, without those shown elsewhere in the report."""
    data = event.data
    if event.kind == "step":
        return str(data.get("detail", ""))
    if event.kind == "result":
        return ""
    said = ", ".join(_list_event_values(data))
    shown = said if len(said) <= MOST_DETAIL else f"{said[:MOST_DETAIL]} …"
    return "; ".join(filter(None, (*(problem_words(each, text) for each in recorded_problems(data)), shown)))


def _list_event_values(data: Mapping[str, object]) -> Iterable[str]:
    for key, value in data.items():
        known = key in NOT_PLAIN or key.endswith("_sha256")  # these stand elsewhere in the report
        if known or value in (None, "", [], {}) or isinstance(value, Mapping):
            continue
        values = value if isinstance(value, list | tuple) else (value,)
        shown = (f"{each:.6g}" if isinstance(each, float) else str(each) for each in values)
        yield f"{key} {', '.join(shown)}"
