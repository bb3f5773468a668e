"""Take the pictures of the documentation from the real program, in a real terminal.

python -m docs.pictures

All in one go through the job: Preview, Run and Inspect at 100x30, and all others at 160x48.

A picture is the grid of the terminal and nothing else. It needs no font but a monospace one: what is not plain
text (plots in braille, bars, frames) is drawn, so that it stands on the grid with every font.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
import unicodedata
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

from console.tui.keymap import PageName
from tests.terminal import Terminal
from tests.terminal_screen import Cell
from tests.trainee import Trainee, console
from tests.tui.records_stage import WRENCH
from tests.tui.scenes import keys_to

FOLDER = Path(__file__).with_name("pictures")
COLUMNS, ROWS = 100, 30
WIDE = (160, 48)  # a terminal on which every page shows side by side what is behind a key elsewhere

# The way of an operator through the job -----------------------------------------------------------------------

SETTLED_S = 0.6
HALF_DONE = re.compile(r"\b(4[5-9]|5\d) %")


FURTHER = {
    PageName.JOBS: "jobs_page.latest",
    PageName.RECORDS: "fact.time",
    PageName.ALARMS: "alarms_page.log_title",
    PageName.MORE: "more.keys",
    PageName.SETTINGS: "settings.next.settings",
    PageName.LOG: "log_page.next.list",
    PageName.TUNE: "tune_page.phase_margin",
    PageName.CALIBRATE: "calibrate_page.why.in_force",
    PageName.CONTROLLER: "controller_page.identity.cid",
}
"""Pages that are looked at after the cut, each with a text that it shows when it has its figures."""

MACHINE = "lee-2001-lathe"


def photograph(terminal: Terminal, folder: Path) -> None:
    """Go through the job as a trainee would, and take a picture of each page when it has its figures.

    Raises:
        AssertionError: a page did not come; with the screen as it was.
    """
    trainee = Trainee(terminal, "en")
    trainee.opens_the_first_job()
    _take_wide(terminal, folder / "setup.svg")
    trainee.press("3")
    trainee.sees("strategy.pvt.how")
    terminal.wait_for(lambda screen: "… um" not in screen and "… Hz" not in screen, 60.0)
    _take(terminal, folder / "preview.svg")
    trainee.aligns()
    _take_wide(terminal, folder / "align.svg")
    trainee.starts_the_cut()
    terminal.wait_for(lambda screen: HALF_DONE.search(screen) is not None, 60.0)
    _take(terminal, folder / "run.svg")
    _take_wide(terminal, folder / "run-wide.svg")
    trainee.waits_for_the_end_of_the_cut()
    trainee.measures()
    terminal.wait_for(r"RONt\D*?\d+\.\d+")
    _take(terminal, folder / "inspect.svg")
    terminal.resize(*WIDE)
    for page, seen in FURTHER.items():
        trainee.press(*keys_to(page))
        trainee.sees(seen)
        time.sleep(SETTLED_S)
        _take(terminal, folder / f"{page}.svg")
    trainee.press(*keys_to(PageName.SCOPE))
    trainee.sees("scope_page.next.empty")
    trainee.press("g")
    trainee.sees("scope_page.next.record", 60.0)
    _take(terminal, folder / "scope.svg")
    terminal.press("ctrl+q")
    terminal.wait_exit()


def _take_wide(terminal: Terminal, path: Path) -> None:
    """Take a picture on the wide terminal, and go back."""
    terminal.resize(*WIDE)
    terminal.wait_for(lambda _: "STOP MOTION" in terminal.row(WIDE[1] - 2))
    time.sleep(SETTLED_S)  # plots are painted once their panels know their size
    _take(terminal, path)
    terminal.resize(COLUMNS, ROWS)


def _take(terminal: Terminal, path: Path) -> None:
    path.write_text(svg(terminal.cells()), encoding="utf-8")
    print(f"written: {path.name}")


# From cells to a picture --------------------------------------------------------------------------------------

CELL_WIDTH, CELL_HEIGHT, FONT_SIZE, BASELINE = 8, 16, 13, 12
FONTS = "ui-monospace,'DejaVu Sans Mono',Menlo,Consolas,'Noto Sans Mono CJK KR',D2Coding,monospace"
FOREGROUND, BACKGROUND = "#c6c6c6", "#121416"
LIGHT, HEAVY = 1.2, 2.4

# Which of the four arms up, right, down, left a frame character has.
ARMS = "rl ud rd dl ur ul urd udl rdl url urdl".split()
LIGHT_ARMS = dict(zip("─│┌┐└┘├┤┬┴┼╭╮╰╯", [*ARMS, *ARMS[2:6]], strict=True))
HEAVY_ARMS = dict(zip("━┃┏┓┗┛┣┫┳┻╋", ARMS, strict=True))
ROUND = "╭╮╰╯"
ENDS = {"u": (4, 0), "r": (8, 8), "d": (4, 16), "l": (0, 8)}
SHADES = {"░": 0.25, "▒": 0.5, "▓": 0.75}


@dataclass(frozen=True, slots=True)
class Ink:
    """How a text is written."""

    colour: str
    bold: bool = False
    italic: bool = False
    underline: bool = False

    def attributes(self) -> str:
        """The same as attributes of SVG."""
        return (
            f'fill="{self.colour}"'
            + ' font-weight="bold"' * self.bold
            + ' font-style="italic"' * self.italic
            + ' text-decoration="underline"' * self.underline
        )


@dataclass(frozen=True, slots=True)
class Run:
    """Characters in a row that are written in one go, at a place in cells."""

    x: int
    y: int
    text: str
    cells: int


def svg(cells: Sequence[Sequence[Cell]]) -> str:
    """Return the picture of a screen, as the text of an SVG file that needs nothing else."""
    width, height = len(cells[0]) * CELL_WIDTH, len(cells) * CELL_HEIGHT
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-8 -8 {width + 16} {height + 16}"'
            f' width="{width + 16}" height="{height + 16}" font-family="{FONTS}" font-size="{FONT_SIZE}">',
            f'<rect x="-8" y="-8" width="{width + 16}" height="{height + 16}" rx="6" fill="{BACKGROUND}"/>',
            *drawn(cells),
            "</svg>\n",
        )
    )


def drawn(cells: Sequence[Sequence[Cell]]) -> Iterator[str]:
    """Yield what is drawn of some rows, from the back to the front."""
    yield from _backgrounds(cells)
    yield from _drawings(cells)
    yield from _texts(cells)


def _colours(cell: Cell) -> tuple[str, str]:
    """Return what is really seen, in front and behind."""
    pair = (cell.foreground or FOREGROUND, cell.background or BACKGROUND)
    return (pair[1], pair[0]) if cell.reverse else pair


def _backgrounds(cells: Sequence[Sequence[Cell]]) -> Iterator[str]:
    """Yield one path for each colour; like stretches in rows one below the other become one rectangle."""
    open_since: dict[tuple[int, int, str], int] = {}
    shapes: defaultdict[str, list[str]] = defaultdict(list)
    for y, row in enumerate([*cells, []]):
        here = {(start, end, colour) for start, end, colour in _stretches(row) if colour != BACKGROUND}
        for stretch in open_since.keys() - here:
            start, end, colour = stretch
            top = open_since.pop(stretch)
            shapes[colour].append(
                _rectangle(start * CELL_WIDTH, top * CELL_HEIGHT, end * CELL_WIDTH, y * CELL_HEIGHT)
            )
        for stretch in here - open_since.keys():
            open_since[stretch] = y
    for colour in sorted(shapes):
        yield f'<path shape-rendering="crispEdges" fill="{colour}" d="{"".join(sorted(shapes[colour]))}"/>'


def _stretches(row: Sequence[Cell]) -> Iterator[tuple[int, int, str]]:
    start = 0
    for x in range(1, len(row) + 1):
        if x == len(row) or _colours(row[x])[1] != _colours(row[start])[1]:
            yield start, x, _colours(row[start])[1]
            start = x


def _rectangle(left: float, top: float, right: float, bottom: float) -> str:
    return f"M{left:g} {top:g}H{right:g}V{bottom:g}H{left:g}z"


def _drawings(cells: Sequence[Sequence[Cell]]) -> Iterator[str]:
    """Yield one path for each colour and kind: dots of braille, lines of frames, blocks of bars."""
    paths: defaultdict[str, list[str]] = defaultdict(list)
    for y, row in enumerate(cells):
        for x, cell in enumerate(row):
            colour = _colours(cell)[0]
            for style, shape in _drawn(cell.text, x * CELL_WIDTH, y * CELL_HEIGHT):
                paths[style.format(colour=colour)].append(shape)
    for style in sorted(paths):
        yield f'<path {style} d="{"".join(paths[style])}"/>'


def _drawn(text: str, left: int, top: int) -> Iterator[tuple[str, str]]:
    """Yield style and shape of what is drawn for a character; nothing for what is written."""
    if "\u2800" <= text <= "\u28ff":
        yield 'fill="none" stroke="{colour}" stroke-width="2"', "".join(_dots(ord(text) - 0x2800, left, top))
    elif text in LIGHT_ARMS:
        yield f'fill="none" stroke="{{colour}}" stroke-width="{LIGHT}"', _frame(text, LIGHT_ARMS[text], left, top)
    elif text in HEAVY_ARMS:
        yield f'fill="none" stroke="{{colour}}" stroke-width="{HEAVY}"', _frame(text, HEAVY_ARMS[text], left, top)
    elif text in SHADES:
        opacity = f' fill-opacity="{SHADES[text]}"'
        yield 'fill="{colour}"' + opacity, _rectangle(left, top, left + CELL_WIDTH, top + CELL_HEIGHT)
    elif (block := _block(text)) is not None:
        x1, y1, x2, y2 = block
        shape = _rectangle(
            left + x1 * CELL_WIDTH, top + y1 * CELL_HEIGHT, left + x2 * CELL_WIDTH, top + y2 * CELL_HEIGHT
        )
        yield 'shape-rendering="crispEdges" fill="{colour}"', shape


def _dots(bits: int, left: int, top: int) -> Iterator[str]:
    """Yield the dots of a braille cell; the bits go down the left, down the right, then the lowest two."""
    for bit, (column, row) in enumerate(((0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3))):
        if bits >> bit & 1:
            yield f"M{left + 4 * column + 1} {top + 4 * row + 2}h2"


def _frame(text: str, arms: str, left: int, top: int) -> str:
    ends = [f"{left + x} {top + y}" for x, y in (ENDS[arm] for arm in arms)]
    centre = f"{left + 4} {top + 8}"
    if text in ROUND:
        return f"M{ends[0]}Q{centre} {ends[1]}"
    if arms in ("rl", "ud"):
        return f"M{ends[0]}L{ends[1]}"
    return "".join(f"M{end}L{centre}" for end in ends)


def _block(text: str) -> tuple[float, float, float, float] | None:
    """Return left, top, right, bottom of a block character, in parts of its cell."""
    code = ord(text) if text else 0
    if code == 0x2580:
        return 0, 0, 1, 0.5
    if 0x2581 <= code <= 0x2588:
        return 0, 1 - (code - 0x2580) / 8, 1, 1
    if 0x2589 <= code <= 0x258F:
        return 0, 0, (0x2590 - code) / 8, 1
    return {0x2590: (0.5, 0, 1, 1), 0x2594: (0, 0, 1, 0.125), 0x2595: (0.875, 0, 1, 1)}.get(code)


def _texts(cells: Sequence[Sequence[Cell]]) -> Iterator[str]:
    """Yield one group for each style, with its runs; each run is held to the width of its cells."""
    groups: defaultdict[Ink, list[Run]] = defaultdict(list)
    for y, row in enumerate(cells):
        for ink, run in _runs(row, y):
            groups[ink].append(run)
    for ink, runs in groups.items():
        yield f"<g {ink.attributes()}>"
        yield from (
            f'<text x="{run.x * CELL_WIDTH}" y="{run.y * CELL_HEIGHT + BASELINE}"'
            f' textLength="{run.cells * CELL_WIDTH}" lengthAdjust="spacingAndGlyphs">{escape(run.text)}</text>'
            for run in runs
        )
        yield "</g>"


def _runs(row: Sequence[Cell], y: int) -> Iterator[tuple[Ink, Run]]:
    """Yield the runs of a row: of one style and of characters that one font has, without blanks at the ends.

    Two blanks end a run, since SVG would make one of them.
    """
    start = 0
    for x in range(1, len(row) + 1):
        if x == len(row) or (row[x].text and _kind(row, x) != _kind(row, start)):
            part = row[start:x]
            text = "".join(cell.text for cell in part)
            if _is_written(part[0]):
                cut = text.rstrip()
                yield _ink(part[0]), Run(start, y, cut, x - start - (len(text) - len(cut)))
            start = x


def _kind(row: Sequence[Cell], x: int) -> tuple[object, ...]:
    """What the cells of a run have in common. A single blank belongs to the text before it."""
    cell = row[x]
    if cell.text == " " and x and row[x - 1].text.strip() and _ink(row[x - 1]) == _ink(cell):
        cell = row[x - 1]
    return _ink(cell), _is_written(cell), _font(cell.text)


def _is_written(cell: Cell) -> bool:
    return bool(cell.text.strip()) and not any(_drawn(cell.text, 0, 0))


def _font(text: str) -> str:
    """Characters for which a browser may take different fonts, and so widths, are told apart."""
    if unicodedata.east_asian_width(text[:1] or " ") in "WF":
        return "wide"
    return "plain" if text < "\u0250" else f"{ord(text[0]) >> 8:x}"


def _ink(cell: Cell) -> Ink:
    return Ink(_colours(cell)[0], cell.bold, cell.italic, cell.underline)


def _calibrated(data: Path) -> None:
    """Keep a calibration of the wrench, as whoever sets up a machine does."""
    folder = data / "calibrations" / MACHINE
    folder.mkdir(parents=True)
    (folder / "wrench.csv").write_text(WRENCH, encoding="utf-8")  # where the page looks for its points
    command = ("calibrate", "chuck", "wrench.csv", "--keep", "--data", str(data))
    subprocess.run((sys.executable, "-m", "console", *command), cwd=folder, check=True, stdout=subprocess.DEVNULL)


def main(arguments: Sequence[str]) -> None:
    """Take all pictures, into the folder given or that of the documentation."""
    folder = Path(arguments[0]) if arguments else FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as data:
        _calibrated(Path(data))
        with console(Path(data), "en", COLUMNS, ROWS, TRILOBE_OPERATOR="kim") as terminal:
            photograph(terminal, folder)


if __name__ == "__main__":
    main(sys.argv[1:])
