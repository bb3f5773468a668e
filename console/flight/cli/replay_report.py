"""Frozen recordings as lines and as JSON: the list of them, and what happened in one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from console.flight.notes import NoteKind
from console.flight.playback import PlaybackEvent, PlaybackEventKind, events_of
from console.flight.recording import Header, Recording, read_header
from console.text.catalogue import Catalogue
from console.text.recorded_words import alarm_words
from profiles.problem import Problem, ProblemError

LONGEST_REPLY = 90  # characters of the lines of one reply that are put into one


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingEntry:
    """A file in the list: its header, or why it cannot be read."""

    path: Path
    header: Header | None = None
    problems: tuple[Problem, ...] = ()

    def fields(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {"file": str(self.path), **({} if self.header is None else _header_fields(self.header))}


def list_recordings(paths: Sequence[Path]) -> list[RecordingEntry]:
    """Return the recordings with their headers; a damaged one is no reason not to list the others."""
    found = []
    for path in paths:
        try:
            found.append(RecordingEntry(path=path, header=read_header(path)))
        except ProblemError as error:
            found.append(RecordingEntry(path=path, problems=tuple(error.problems)))
    return found


def listed_lines(found: Sequence[RecordingEntry], text: Catalogue) -> list[str]:
    """Return a line for each recording: time, machine, length, reason, and its name."""
    known = [entry for entry in found if entry.header is not None]
    if not known:
        return [text("replay.none")]
    return [_listed_line(entry.path, entry.header, text) for entry in known if entry.header is not None]


def _listed_line(path: Path, header: Header, text: Catalogue) -> str:
    simulated = f"{text('sim')} " if header.simulated else ""
    reasons = ", ".join(_reason(cause.reason, text) for cause in header.causes[:1])
    more = f" +{len(header.causes) - 1}" if len(header.causes) > 1 else ""
    at = _utc(header, header.causes[0].at_s if header.causes else header.ended_s)
    return f"{at}  {simulated}{header.machine.name}  {header.length_s:.0f} s  {reasons}{more}\n    {path.name}"


def replay_lines(recording: Recording, text: Catalogue) -> list[str]:
    """Return what happened, one line each: time of day, seconds from the beginning, and the event in words."""
    header = recording.header
    simulated = f" ({text('sim')})" if header.simulated else ""
    head = [
        text("replay.text.title", machine=f"{header.machine.name}{simulated}", software=header.software),
        text("replay.text.span", begin=_utc(header, header.began_s), seconds=f"{header.length_s:.0f}"),
        *(f"{text('replay.text.cause')}: {_reason(cause.reason, text)}" for cause in header.causes),
        "",
    ]
    first_s = recording.times_s[0]
    rows = [
        f"{_utc(header, event.at_s)[11:21]}  {max(event.at_s - first_s, 0.0):8.1f}  {event_words(event, text)}"
        for event in _join_reply_lines(events_of(recording))
    ]
    return [*head, *rows]


def _join_reply_lines(events: Sequence[PlaybackEvent]) -> Iterator[PlaybackEvent]:
    """Yield the events, with the lines of one reply in one."""
    reply: PlaybackEvent | None = None
    for event in events:
        answers = event.kind is NoteKind.LINK and event.word.startswith("< ")
        if reply is not None and answers and len(reply.word) + len(event.word) < LONGEST_REPLY:
            reply = replace(reply, word=f"{reply.word} | {event.word[2:]}")
            continue
        if reply is not None:
            yield reply
        reply = event if answers else None
        if not answers:
            yield event
    if reply is not None:
        yield reply


def replay_fields(recording: Recording, text: Catalogue) -> dict[str, Any]:
    """Return the same for JSON, with codes beside the sentences."""
    header = recording.header
    return {
        "file": str(recording.path),
        **_header_fields(header),
        "moments": len(recording.moments),
        "events": [
            {
                "utc": _utc(header, event.at_s, "milliseconds"),
                "at_s": event.at_s - recording.times_s[0],
                "kind": event.kind.value,
                "value": event.word,
                "code": "" if event.problem is None else event.problem.code,
                "text": event_words(event, text),
            }
            for event in events_of(recording)
        ],
    }


def event_words(event: PlaybackEvent, text: Catalogue) -> str:
    """Return an event in one line."""
    if event.problem is not None:
        return text(f"replay.event.{event.kind}", value=text.problem(event.problem))
    match event.kind:
        case PlaybackEventKind.STOPPED | NoteKind.STOP | NoteKind.KILL:
            value = text.reason(event.word)
        case NoteKind.FROZEN:
            value = _reason(event.word, text)
        case PlaybackEventKind.ACTIVITY:
            value = text(f"activity.{event.word}")
        case PlaybackEventKind.PAGE:
            value = text(f"page.{event.word}") if event.word else ""
        case _:
            value = event.word
    return text(f"replay.event.{event.kind}", value=value)


def _header_fields(header: Header) -> dict[str, Any]:
    causes = [(each.reason, _utc(header, each.at_s, "milliseconds")) for each in header.causes]
    return {
        "machine": header.machine.name,
        "simulated": header.simulated,
        "software": header.software,
        "console": header.console,
        "began_utc": _utc(header, header.began_s, "milliseconds"),
        "length_s": header.length_s,
        "causes": [{"utc": utc, "reason": reason} for reason, utc in causes],
    }


def _utc(header: Header, at_s: float, timespec: str = "seconds") -> str:
    at = datetime.fromtimestamp(header.utc_of(at_s), UTC).replace(tzinfo=None)
    if timespec == "seconds":
        return f"{at:%Y-%m-%d %H:%M:%S}.{at.microsecond // 100_000} UTC"
    return f"{at.isoformat(timespec=timespec)}Z"


def _reason(reason: str, text: Catalogue) -> str:
    kind, _, key = reason.partition(" ")
    if kind == "stop" and key:
        return text("replay.reason.stop", value=text.reason(key))
    if reason in ("killed", "crash"):
        return text(f"replay.reason.{reason}")
    if "." in reason:
        return text("replay.reason.alarm", value=alarm_words(reason, text))
    return text("replay.reason.signal", value=reason)
