"""Lines of text as pieces with tokens, aligned by cells, and the panel that repaints only changed cells."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import combinations_with_replacement, zip_longest

from rich.cells import cell_len, set_cell_size
from rich.segment import Segment
from textual.content import Content
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from console.escaping import escaped_line
from console.tui.theme import Palette, Token

Piece = tuple[str, Token]
Line = tuple[Piece, ...]
BLANK: Line = ()
_LEAST_HEAD, _LEAST_AMONG = 6, 14  # cells before the ellipsis, and of a name that is told apart from others
NOTHING = "–"  # placeholder where there is no value, or none that may be judged


def line(*pieces: str | Piece) -> Line:
    """Return a line; a bare text is plain text."""
    return tuple((piece, Token.TEXT) if isinstance(piece, str) else piece for piece in pieces)


def dim(text: str) -> Piece:
    """Return a piece that needs no attention."""
    return text, Token.DIM


@lru_cache(maxsize=1024)  # most lines of a tick are those of the tick before; so below
def width_of(pieces: Line) -> int:
    """Return the width of a line in cells."""
    return sum(cell_len(text) for text, _ in pieces)


def fit_text(text: str, width: int) -> str:
    """Return a text of exactly `width` cells: padded, or cut with an ellipsis."""
    if cell_len(text) <= width:
        return set_cell_size(text, width)
    return set_cell_size(set_cell_size(text, max(width - 1, 0)) + "…", width) if width > 0 else ""


def name_in(name: str, width: int, *, tail_fraction: float = 0.5) -> str:
    """Return a name in at most `width` cells; a longer one loses its middle, because names differ at the end.

    `tail_fraction` of what is left is its end.
    """
    if cell_len(name) <= width:
        return name
    if width < 4:
        return fit_text(name, max(width, 0)).rstrip()
    return "…".join(_ends(name, width, tail_fraction))


@lru_cache(maxsize=256)
def name_among(name: str, others: tuple[str, ...], width: int, *, tail_fraction: float = 0.5) -> str:
    """Return a name as `name_in` does, but for one that would then look like another of `others`.

    Of that the end begins where it differs, or pieces from there are shown in its middle.
    """
    if cell_len(name) <= width or width < _LEAST_AMONG:
        return name_in(name, width, tail_fraction=tail_fraction)
    shown = head, tail = _ends(name, width, tail_fraction)
    similar = [each for each in others if each != name and each.startswith(head[:4]) and each.endswith(tail[-1])]
    starts = sorted({_common_prefix_length(name, each) for each in similar})
    forms: list[tuple[str, ...]] = [
        shown,
        *(_abbreviate_name(name, pair, width) for pair in combinations_with_replacement(starts, 2)),
    ]
    # The first form that no other name can have, or of those that the fewest can the one with most pieces.
    counted = [(_number_with(similar, form), form) for form in forms]
    return "…".join(min(counted, key=lambda each: (each[0], -len(each[1]) if each[0] else 0))[1])


def _abbreviate_name(name: str, starts: tuple[int, int], width: int) -> tuple[str, ...]:
    """Return a form of a name in `width` cells that has what begins at two places, or at one that is both."""
    end = name[starts[0] :]
    if cell_len(end) <= width - _LEAST_HEAD:
        return _head(name, width - 1 - cell_len(end)), end
    places = sorted({*starts})
    room = width - 1 - len(places)
    pieces = [_head(name[place:], room // (len(places) + 2)) for place in places]
    first = _head(name, (room - sum(map(cell_len, pieces))) // 2)[: places[0]]
    return first, *pieces, _tail(name, room - cell_len("".join((first, *pieces))))


def _ends(name: str, width: int, tail_fraction: float) -> tuple[str, str]:
    """Return what is left of a name without its middle, in `width` cells with an ellipsis between."""
    tail = _tail(name, int((width - 1) * tail_fraction))
    return _head(name, width - 1 - cell_len(tail)), tail


def _common_prefix_length(name: str, other: str) -> int:
    """Return how many characters two names have in common at their beginning."""
    return next(
        (place for place, pair in enumerate(zip(name, other, strict=False)) if pair[0] != pair[1]), len(other)
    )


def _tail(name: str, width: int) -> str:
    return _head(name[::-1], width)[::-1]


def _number_with(names: Sequence[str], pieces: Sequence[str]) -> int:
    """Return how many names could be shortened to these pieces."""
    first, *between, last = pieces
    alike = (
        each[len(first) : len(each) - len(last)]
        for each in names
        if each.startswith(first) and each.endswith(last)
    )
    return sum(all(piece in middle for piece in between) for middle in alike)


def to_the_right(text: str, width: int) -> str:
    """Return a text padded with blanks on its left."""
    return " " * max(width - cell_len(text), 0) + text


def clip_lines(lines: list[Line], height: int | None, more: str) -> list[Line]:
    """Return what fits, all without a height; the last row is `more` where it continues: how to see the rest."""
    if height is None or len(lines) <= height:
        return lines
    return [*lines[: max(height - 1, 0)], ((more, Token.WARNING),)][: max(height, 0)]


def first_fitting(height: int | None, more: str, *layouts: list[Line]) -> list[Line]:
    """Return the first of the layouts that fits, the first without a height; clip the last where none fits."""
    fitting = (lines for lines in layouts if height is None or len(lines) <= height)
    return next(fitting, None) or clip_lines(layouts[-1], height, more)


@lru_cache(maxsize=512)
def justify_line(left: Line, right: Line, width: int) -> Line:
    """Return one line with `left` left-aligned and `right` right-aligned; the left one is shortened."""
    room = width - width_of(right)
    kept: list[Piece] = []
    for text, token in left:
        piece = fit_text(text, room) if cell_len(text) > room else text
        room -= cell_len(piece)
        kept.append((piece, token))
    return (*kept, (" " * max(room, 0), Token.TEXT), *right)


def fact(label: str, value: str, width: int, *, label_width: int, token: Token = Token.TEXT) -> Line:
    """Return a row of a panel: a dim label, and its value right-aligned in `width`."""
    room = max(width - label_width, 0)
    shown = fit_text(value, room) if cell_len(value) > room else to_the_right(value, room)
    return (fit_text(label, label_width), Token.DIM), (shown, token)


def wrap_line(text: str, width: int, token: Token = Token.TEXT, *, first: int | None = None) -> list[Line]:
    """Return a text broken at spaces (long words anywhere) into lines of `width` cells, the first of `first`."""
    return list(_wrap_line(text, width, token, first))


@lru_cache(maxsize=512)
def _wrap_line(text: str, width: int, token: Token, first: int | None) -> tuple[Line, ...]:
    lines: list[str] = []
    current = ""
    for word in text.split():
        while True:
            room = width if lines or first is None else first
            longer = f"{current} {word}" if current else word
            if cell_len(longer) <= room:
                current = longer
                break
            if current:
                lines.append(current)
                current = ""
                continue
            head = _head(word, room)
            lines.append(head)
            word = word[len(head) :]
            if not word:
                break
    if current:
        lines.append(current)
    return tuple(((text_, token),) for text_ in lines)


def hanging(mark: Piece, text: str, width: int, token: Token = Token.TEXT, *, beside: Line = BLANK) -> list[Line]:
    """Return a text with a hanging indent after its mark; `beside` is at the right end of the first line."""
    indent = cell_len(mark[0])
    room = max(width - indent, 1)
    free = max(room - width_of(beside) - bool(beside), 1)
    first, *rest = wrap_line(text, room, token, first=free) or [BLANK]
    return [justify_line((mark, *first), beside, width), *((dim(" " * indent), *more) for more in rest)]


def to_strip(pieces: Iterable[Piece], width: int, palette: Palette) -> Strip:
    """Return a strip of exactly `width` cells; every cell has a style."""
    strip = Strip([Segment(text, palette[token]) for text, token in pieces if text])
    return strip.adjust_cell_length(width, palette[Token.TEXT])


def plain_text(lines: Sequence[Line]) -> str:
    """Return the text of lines without their tokens."""
    return "\n".join("".join(text for text, _ in pieces).rstrip() for pieces in lines)


def find_changed_cells(before: Line, after: Line) -> tuple[int, int]:
    """Return the cells, first and past the last, in which two lines differ; (0, 0) where they do not."""
    # Most often a label stays and its value changes: cells are compared from the first piece that differs.
    same = next((place for place, pair in enumerate(zip(before, after, strict=False)) if pair[0] != pair[1]), 0)
    start = width_of(before[:same])
    cells = zip_longest(_cells(before[same:]), _cells(after[same:]), fillvalue=(" ", Token.TEXT))
    places = [place for place, (old, new) in enumerate(cells) if old != new]
    return (start + places[0], start + places[-1] + 1) if places else (0, 0)


def _cells(pieces: Line) -> Iterator[Piece]:
    """Yield one entry for each cell; the second cell of a wide character belongs to the first."""
    for text, token in pieces:
        for character in text:
            yield from [(character, token)] * cell_len(character)


def _head(word: str, width: int) -> str:
    """Return the longest prefix of `word` that fits, one character at least."""
    fitting = (word[:end] for end in range(len(word), 1, -1) if cell_len(word[:end]) <= width)
    return next(fitting, word[:1])


class Sheet(Widget, can_focus=False):
    """Lines of pieces; what does not fit the panel is cut off."""

    def __init__(self, palette: Palette, *, id: str | None = None, classes: str | None = None) -> None:
        super().__init__(id=id, classes=classes)
        self._palette = palette
        self.lines: tuple[Line, ...] = ()
        self._given: tuple[Line, ...] = ()

    def show(self, lines: Sequence[Line], title: str | None = None, subtitle: str = "") -> None:
        """Show these lines, and these titles where they are given; unchanged cells are not painted again."""
        if title is not None:
            entitle(self, title, subtitle)
        given = tuple(lines)
        if given == self._given:
            return
        self._given = given
        before, self.lines = self.lines, tuple(_harmless(each) for each in lines)
        regions = []
        for row, (old, new) in enumerate(zip_longest(before, self.lines, fillvalue=BLANK)):
            if old != new:
                first, end = find_changed_cells(old, new)
                regions.append(Region(first, row, end - first, 1))
        # A row beyond the present height has its place only after the next layout: until then it would be painted
        # over the widget below, and a wide character there that straddles its end would lose its other half.
        if any(region.y >= self.size.height for region in regions):
            self.refresh()
        elif regions:
            self.refresh(*regions)

    def render_line(self, y: int) -> Strip:
        """Return one row."""
        pieces = self.lines[y] if y < len(self.lines) else BLANK
        return to_strip(pieces, self.size.width, self._palette)


def entitle(panel: Widget, title: str, subtitle: str = "") -> None:
    """Set the titles of a panel where they differ. Names in them may contain brackets, which are no markup."""
    for name, words in (("border_title", title), ("border_subtitle", subtitle)):
        content, markup = _content(words)
        if getattr(panel, name) != markup:
            setattr(panel, name, content)


@lru_cache(maxsize=256)
def _content(words: str) -> tuple[Content, str]:
    content = Content(words)
    return content, content.markup


@lru_cache(maxsize=512)
def _harmless(pieces: Line) -> Line:
    """Return a line that cannot control the terminal, whatever the names in it."""
    if all(text.isprintable() for text, _ in pieces):
        return pieces
    return tuple((escaped_line(text), token) for text, token in pieces)
