"""The time bar of a replay, in the place of the stop: where it is, how fast, and what happened when."""

from __future__ import annotations

from console.flight.notes import Kind
from console.flight.playback import Event, Happened, Playback
from console.tui.lines import Line, width_of
from console.tui.theme import Token

_SIGNS = {
    Happened.ALARM: (3, "!", Token.WARNING),
    Happened.STOPPED: (2, "■", Token.STRONG),
    Kind.STOP: (2, "■", Token.STRONG),
    Kind.KILL: (2, "■", Token.STRONG),
    Kind.KEY: (1, "·", Token.KEY),
}
"""Rank, sign and colour of a mark; where two meet, the higher rank is shown."""

LEAST_TRACK = 8


def clock_words(seconds: float) -> str:
    """Return a time as minutes and seconds with a tenth."""
    tenths = round(10.0 * seconds)
    return f"{tenths // 600}:{tenths % 600 // 10:02d}.{tenths % 10}"


def time_bar(playback: Playback, width: int) -> Line:
    """Return the row: paused or playing, speed, time of all, and the track with its marks."""
    sign = "▶" if playback.playing else "‖"
    speed = f"x{playback.speed:g}"
    length_s = playback.recording.length_s
    times = f"{clock_words(playback.past_s)} / {clock_words(length_s)}"
    head: list[tuple[str, Token]] = [(f" {sign} {speed:<5}", Token.ACTION), (f"{times}  ", Token.TEXT)]
    room = width - width_of(tuple(head)) - 1
    return (*head, *_track(playback, room)) if room >= LEAST_TRACK else tuple(head)


def _track(playback: Playback, cells: int) -> Line:
    first_s, length_s = playback.recording.times_s[0], max(playback.recording.length_s, 1e-9)

    def cell(at_s: float) -> int:
        return min(max(round((at_s - first_s) / length_s * (cells - 1)), 0), cells - 1)

    marks: dict[int, tuple[int, str, Token]] = {}
    for event in playback.events:
        mark = _mark(event)
        place = cell(event.at_s)
        if mark is not None and mark[0] > marks.get(place, (0, "", Token.DIM))[0]:
            marks[place] = mark
    marks[cell(playback.at_s)] = (4, "●", Token.STRONG)
    return tuple(marks[place][1:] if place in marks else ("─", Token.DIM) for place in range(cells))


def _mark(event: Event) -> tuple[int, str, Token] | None:
    return None if event.is_low else _SIGNS.get(event.kind)
