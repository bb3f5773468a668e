"""What a terminal shows for the bytes that it is sent: pyte, without what pyte misreads."""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass

import pyte

FRAME_BEGIN, FRAME_END = "\x1b[?2026h", "\x1b[?2026l"
FRAME_QUERY = "\x1b[?2026$p"
ALTERNATE = re.compile(r"\x1b\[\?1049([hl])")
SEQUENCE = re.compile(
    r"\x1b(?:\[[0-?]*[ -/]*[@-~]|[\]PX^_].*?(?:\x1b\\|\x07)|[ -/]+[0-~]|[0-OQ-WYZ`-~])", re.DOTALL
)
UNFINISHED = re.compile(r"\x1b(?:\[[0-?]*[ -/]*|[\]PX^_](?:(?!\x1b\\|\x07).)*|[ -/]*)?\Z", re.DOTALL)
# The rest is misread by pyte: `CSI = 0;1 u` leaves text behind, `CSI > 4;2 m` underlines, `CSI ? 4 m` raises.
UNDERSTOOD = re.compile(r"\x1b(?:\[[0-9;]*[@-~]|\[\?[0-9;]*[hl]|[78DEHMc])")
# pyte drops the rest of a text at a character without width.
NO_WIDTH = re.compile("[\x00\x7f-\x9f\u200b-\u200f\u2060\ufe00-\ufe0f\ufeff]")

NAMES = ("black", "red", "green", "brown", "blue", "magenta", "cyan", "white")
ANSI_COLOURS = {
    **dict(zip(NAMES, pyte.graphics.FG_BG_256[:8], strict=True)),
    **{f"bright{name}": colour for name, colour in zip(NAMES, pyte.graphics.FG_BG_256[8:16], strict=True)},
    "bfightmagenta": pyte.graphics.FG_BG_256[13],  # So spelled in pyte, for backgrounds.
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One cell as it is drawn; `text` is empty in the second cell of a wide character.

    Colours are `#rrggbb`, or empty for the terminal's own; a reversed cell keeps its colours unswapped.
    """

    text: str
    foreground: str = ""
    background: str = ""
    bold: bool = False
    italic: bool = False
    underline: bool = False
    reverse: bool = False


CURSOR_QUERY = re.compile(r"\x1b\[(\d+);(\d+)H\x1b\[6n")


class Emulation:
    """What a modern terminal makes of the bytes: two screens, frames shown whole, wide characters in two cells."""

    def __init__(self, columns: int, rows: int) -> None:
        self._screens = (pyte.Screen(columns, rows), pyte.Screen(columns, rows))
        self._shown = self._screens[0]
        self._stream = pyte.Stream(self._shown)
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._held = ""
        self.reports = b""
        """What a terminal answers to the questions for its cursor so far; whoever sends it takes it away."""

    def feed(self, data: bytes, *, last: bool = False) -> int:
        """Draw what is complete and hold the rest; return how often the program asked for frame support."""
        text = self._held + self._decoder.decode(data, last)
        ready = len(text) if last else _end_of_the_complete(text)
        self._held = text[ready:]
        for asked in CURSOR_QUERY.finditer(text, 0, ready):
            self.reports += f"\x1b[{asked[1]};{asked[2]}R".encode()
        pieces = ALTERNATE.split(text[:ready])
        self._draw(pieces[0])
        for letter, piece in zip(pieces[1::2], pieces[2::2], strict=True):
            self._switch(alternate=letter == "h")
            self._draw(piece)
        return text.count(FRAME_QUERY, 0, ready)

    def resize(self, columns: int, rows: int) -> None:
        for screen in self._screens:
            # By itself pyte would take the rows away at the top.
            for y in [y for y in screen.buffer if y >= rows]:
                del screen.buffer[y]
            screen.lines = rows
            screen.resize(columns=columns)
            screen.set_margins()
            screen.ensure_hbounds()
            screen.ensure_vbounds()

    def cells(self) -> list[list[Cell]]:
        screen = self._shown
        return [[_cell(screen.buffer[y][x]) for x in range(screen.columns)] for y in range(screen.lines)]

    def rows(self) -> list[str]:
        screen = self._shown
        lines = ([screen.buffer[y][x].data for x in range(screen.columns)] for y in range(screen.lines))
        return ["".join(line).rstrip() for line in lines]

    def _draw(self, text: str) -> None:
        kept = SEQUENCE.sub(lambda found: found[0] if UNDERSTOOD.fullmatch(found[0]) else "", text)
        self._stream.feed(NO_WIDTH.sub("", kept))
        for y in self._shown.dirty:
            self._mend_halves(y)
        self._shown.dirty.clear()

    def _mend_halves(self, y: int) -> None:
        """Blank the half that remains of a wide character when something is written over the other half."""
        line = self._shown.buffer[y]
        for x in [x for x, char in line.items() if char.data == "" and not _is_wide(line[x - 1].data)]:
            line[x] = line[x]._replace(data=" ")
        for x in [x for x, char in line.items() if _is_wide(char.data) and line[x + 1].data != ""]:
            line[x] = line[x]._replace(data=" ")

    def _switch(self, *, alternate: bool) -> None:
        if alternate:
            self._screens[1].reset()
        self._stream.detach(self._shown)
        self._shown = self._screens[alternate]
        self._stream.attach(self._shown)


def _end_of_the_complete(text: str) -> int:
    """Where a sequence or a frame begins whose end has not come yet."""
    tail = UNFINISHED.search(text)
    ready = tail.start() if tail else len(text)
    begin = text.rfind(FRAME_BEGIN, 0, ready)
    return begin if begin >= 0 and text.find(FRAME_END, begin, ready) < 0 else ready


def _is_wide(text: str) -> bool:
    return bool(text) and pyte.screens.wcwidth(text[0]) == 2


def _cell(char: pyte.screens.Char) -> Cell:
    return Cell(
        text=char.data,
        foreground=_colour(char.fg),
        background=_colour(char.bg),
        bold=char.bold,
        italic=char.italics,
        underline=char.underscore,
        reverse=char.reverse,
    )


def _colour(name: str) -> str:
    return "" if name == "default" else f"#{ANSI_COLOURS.get(name, name)}"
