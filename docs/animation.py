"""Film the way from the start to a round part, from the real program in a real terminal, as one animated picture.

python -m docs.animation

The picture is an SVG with style sheets and no script. Each row of the terminal is drawn once for as long as it
stays as it is, so that the size grows with what changes. Where nothing may move, it shows the last frame.
"""

from __future__ import annotations

import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import escape

from docs.pictures import (
    BACKGROUND,
    BASELINE,
    CELL_HEIGHT,
    CELL_WIDTH,
    FONT_SIZE,
    FONTS,
    SETTLED_S,
    drawn,
)
from tests.terminal import Terminal
from tests.terminal_screen import Cell
from tests.trainee import Trainee, console

PICTURE = Path(__file__).with_name("pictures") / "first-part.svg"
COLUMNS, ROWS = 100, 30
PLANT, SEED = "easy", ("--seed", "1")
"""A lathe that is not quite as its job says: its first part shows what is left to learn."""

READ_S = 2.6
MOST_ALARMS = 5  # a busy computer raises some of its own
CAPTION, ACCENT = "#eeeeee", "#5fafff"

Row = tuple[Cell, ...]

# Filming ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Frame:
    """The terminal as it is shown for some time, with what is said below it."""

    rows: tuple[Row, ...]
    caption: str
    shown_s: float


@dataclass(slots=True)
class Film:
    """Frames in a row, taken from a terminal."""

    terminal: Terminal
    frames: list[Frame] = field(default_factory=list)
    caption: str = ""

    def show(self, caption: str, shown_s: float = READ_S) -> None:
        """Take a frame that stays for somebody to read, once all of its panels are painted."""
        self.caption = caption
        time.sleep(SETTLED_S)
        self._take(shown_s)

    @contextmanager
    def lapse(self, caption: str, every_s: float, shown_s: float) -> Iterator[None]:
        """Take a frame every so often for as long as the context lasts, each shown so long."""
        self.caption = caption
        over = threading.Event()

        def watch() -> None:
            while not over.wait(every_s):
                self._take(shown_s)

        watching = threading.Thread(target=watch, name="film", daemon=True)
        watching.start()
        try:
            yield
        finally:
            over.set()
            watching.join()

    def _take(self, shown_s: float) -> None:
        rows = tuple(tuple(row) for row in self.terminal.cells())
        if not self.frames or (rows, self.caption) != (self.frames[-1].rows, self.frames[-1].caption):
            self.frames.append(Frame(rows, self.caption, shown_s))


def first_part(terminal: Terminal) -> Sequence[Frame]:
    """Go from the start to the second part as a trainee would; return the frames.

    Raises:
        AssertionError: a page did not come; with the screen as it was.
    """
    film, trainee = Film(terminal), Trainee(terminal, "en")
    trainee.sees("activity.ready", 30.0)
    film.show("1 Jobs: Enter opens the job")
    trainee.opens_the_first_job()
    film.show("2 Set-up: force, depth, speed and feed are checked")
    trainee.press("3")
    trainee.sees("strategy.pvt.how")
    trainee.press("c")
    trainee.sees("strategy.cam.how")
    terminal.wait_for(lambda screen: "… um" not in screen and "… Hz" not in screen, 60.0)
    film.show("3 Preview: the lobe, the tool path against it, what it demands")
    with film.lapse("4 Align: clamp, drives, home, jaw 1 to the mark, touch off (time lapse)", 0.9, 0.25):
        trainee.aligns()
    film.show("4 Align: valid until something that it depends on changes", 1.5)
    _cut(film, trainee, "5 Run: the first part; Space stops", 0.35)
    _measure(trainee)
    film.show("6 Inspect: the first part, measured. a accepts what it teaches", 4.0)
    trainee.press("a")
    trainee.sees("inspect_page.next.kept")
    film.show("6 Inspect: the next cut uses it. Enter: next part", 1.8)
    with film.lapse("4 Align: a new blank; drives on", 0.5, 0.5):
        trainee.press("enter")
        trainee.sees("align_page.next.clamp")
        trainee.press("enter")
        trainee.sees("align_page.next.drives")
        trainee.does_step("align_page.valid_title")
    _cut(film, trainee, "5 Run: the second part, with what the first one taught", 0.2)
    _measure(trainee)
    film.show("6 Inspect: the second part. Every run is kept: 7", 6.0)
    return film.frames


def _cut(film: Film, trainee: Trainee, caption: str, shown_s: float) -> None:
    trainee.press("5")
    trainee.sees("run_page.next.arm")
    trainee.press("f5")
    trainee.sees("run_page.next.armed")
    film.show("5 Run: F5 arms and shows what will happen; F6 starts", 3.0)
    with film.lapse(caption, 0.6, shown_s):
        trainee.press("f6")
        trainee.sees("activity.cutting", 30.0)
        trainee.waits_for_the_end_of_the_cut()
    if "k acknowledges" in trainee.terminal.text:
        film.show("5 Run: the alarm is over; k acknowledges it", 1.6)
    for _ in range(MOST_ALARMS):
        if "k acknowledges" in trainee.terminal.text:
            trainee.press("k")
            time.sleep(SETTLED_S)


def _measure(trainee: Trainee) -> None:
    trainee.press("6")
    trainee.sees("inspect_page.next.measure")
    trainee.press("m")
    trainee.terminal.wait_for(r"RONt LSC\D*?\d+\.\d+", 20.0)


# From frames to a picture -------------------------------------------------------------------------------------

Spans = tuple[tuple[float, float], ...]


def animated(frames: Sequence[Frame]) -> str:
    """Return the frames as one endless picture, as the text of an SVG file that needs nothing else."""
    length_s = sum(frame.shown_s for frame in frames)
    pieces = dict(_pieces(frames))
    names = {spans: f"k{n}" for n, spans in enumerate(dict.fromkeys(pieces.values()))}
    rows, columns = len(frames[0].rows), len(frames[0].rows[0])
    width, height = columns * CELL_WIDTH + 16, rows * CELL_HEIGHT + 48
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-8 -8 {width} {height}" width="{width}"'
            f' height="{height}" font-family="{FONTS}" font-size="{FONT_SIZE}">',
            "<style>",
            *_style(names, length_s),
            "</style>",
            f'<rect x="-8" y="-8" width="{width}" height="{height}" rx="6" fill="{BACKGROUND}"/>',
            *(_group(piece, names[spans], spans, length_s) for piece, spans in pieces.items()),
            f'<rect class="bar" x="-8" y="{height - 11}" width="{width}" height="3" fill="{ACCENT}"/>',
            "</svg>\n",
        )
    )


def _pieces(frames: Sequence[Frame]) -> Iterator[tuple[str, Spans]]:
    """Yield each piece that is ever seen, a row in its place or a caption, with when it is seen, s."""
    seen: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
    drawings: dict[Row, str] = {}
    begin_s = 0.0
    for frame in frames:
        end_s = begin_s + frame.shown_s
        for piece in _of_frame(frame, drawings):
            if seen[piece] and seen[piece][-1][1] == begin_s:
                begin_s_before, _ = seen[piece].pop()
                seen[piece].append((begin_s_before, end_s))
            else:
                seen[piece].append((begin_s, end_s))
        begin_s = end_s
    return ((piece, tuple(spans)) for piece, spans in seen.items())


def _of_frame(frame: Frame, drawings: dict[Row, str]) -> Iterator[str]:
    for y, row in enumerate(frame.rows):
        if row not in drawings:
            drawings[row] = "".join(drawn([row]))
        if drawings[row]:
            yield f'transform="translate(0 {y * CELL_HEIGHT})">{drawings[row]}'
    y = len(frame.rows) * CELL_HEIGHT + BASELINE + 8
    yield f'fill="{CAPTION}" font-weight="bold"><text x="8" y="{y}">{escape(frame.caption)}</text>'


def _group(piece: str, name: str, spans: Spans, length_s: float) -> str:
    last = " z" if spans[-1][1] == length_s else ""
    return f'<g class="{name}{last}" {piece}</g>'


def _style(names: dict[Spans, str], length_s: float) -> Iterator[str]:
    """Yield the rules: what is seen in the last frame is seen where nothing moves."""
    yield f"g[class]{{visibility:hidden;animation:{length_s:g}s step-end infinite}}g.z{{visibility:visible}}"
    yield f".bar{{transform-origin:-8px 0;animation:bar {length_s:g}s linear infinite}}"
    yield "@keyframes bar{from{transform:scaleX(0)}}"
    for spans, name in names.items():
        if spans != ((0.0, length_s),):
            yield f"g.{name}{{animation-name:{name}}}@keyframes {name}{{{_steps(spans, length_s)}}}"
    yield "@media(prefers-reduced-motion:reduce){g[class],.bar{animation:none}}"


def _steps(spans: Spans, length_s: float) -> str:
    changes = {0.0: "hidden"}
    for begin_s, end_s in spans:
        changes[begin_s] = "visible"
        changes[end_s] = "hidden" if end_s < length_s else "visible"
    return "".join(f"{100.0 * at_s / length_s:.4g}%{{visibility:{how}}}" for at_s, how in changes.items())


def main(arguments: Sequence[str]) -> None:
    """Film, to the file given or that of the documentation."""
    path = Path(arguments[0]) if arguments else PICTURE
    with tempfile.TemporaryDirectory() as data:
        with console(Path(data), "en", COLUMNS, ROWS, plant=PLANT, words=SEED, TRILOBE_OPERATOR="kim") as terminal:
            frames = first_part(terminal)
            terminal.press("ctrl+q")
            terminal.wait_exit()
    path.write_text(animated(frames), encoding="utf-8")
    length_s, size_kb = sum(frame.shown_s for frame in frames), path.stat().st_size // 1000
    print(f"written: {path.name}, {length_s:.0f} s, {size_kb} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
