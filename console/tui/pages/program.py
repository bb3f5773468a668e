"""Program to be sent, line by line, with the findings of the checker on top; it scrolls."""

from __future__ import annotations

from textual.events import Resize

from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, Sheet, dim, line
from console.tui.pages.preview_lines import UNKNOWN, finding_lines, findings_of
from console.tui.theme import Palette, Token
from drivers.cutting.planning import CutPlan
from drivers.cutting.strategy import Strategy
from drivers.preview.preview import Underway

_COMMENT = ";"


def program_lines(text: str, width: int) -> list[Line]:
    """Return a program with numbered lines; a long one continues in the next row, and nothing is left out.

    A comment after a semicolon is dim, because it is not sent.
    """
    rows = text.rstrip("\n").split("\n")
    number_width = len(str(len(rows)))
    room = max(width - number_width - 1, 1)
    lines: list[Line] = []
    for number, row in enumerate(rows, start=1):
        code, mark, comment = row.partition(_COMMENT)
        for start in range(0, max(len(row), 1), room):
            head = f"{number:>{number_width}} " if start == 0 else " " * (number_width + 1)
            end = start + room
            sent, remark = code[start:end], (mark + comment)[max(start - len(code), 0) : max(end - len(code), 0)]
            lines.append(line(dim(head), (sent, Token.TEXT), dim(remark)))
    return lines


def program_rows(seen: Underway, strategy: Strategy, text: Catalogue, width: int) -> list[Line]:
    """Return the findings in words, then the program, if there is one."""
    found = finding_lines(findings_of(seen, strategy), text, width)
    plan = seen.strategies.get(strategy)
    if plan is None:
        return [*found, line(dim(f"{UNKNOWN} "), text("preview_page.checking"))]
    head = found or [line(("✓ ", Token.OK), text("preview_page.no_findings"))]
    return [*head, BLANK, *program_lines(plan.text, width)] if isinstance(plan, CutPlan) else head


class ProgramView(Sheet):
    """The rows of one program; `scroll_rows` moves through them."""

    def __init__(self, palette: Palette, text: Catalogue, *, id: str | None = None) -> None:
        super().__init__(palette, id=id)
        self._text = text
        self._shown: tuple[Underway, Strategy] | None = None
        self._first = 0

    def show_program(self, seen: Underway, strategy: Strategy) -> None:
        """Show the program of a strategy; another one begins at its top."""
        before, self._shown = self._shown, (seen, strategy)
        if before is None or before[0].strategies.get(before[1]) is not seen.strategies.get(strategy):
            self._first = 0
        self._lay()

    def scroll_pages(self, pages: float) -> None:
        """Move by so many heights of the panel, downwards positive."""
        self._first += round(pages * self.size.height)
        self._lay()

    def on_resize(self, event: Resize) -> None:
        """Lay the rows out for the new size."""
        self._lay()

    def _lay(self) -> None:
        if self._shown is None:
            return
        rows = program_rows(*self._shown, self._text, self.size.width)
        height = max(self.size.height, 1)
        self._first = min(max(self._first, 0), max(len(rows) - height, 0))
        last = min(self._first + height, len(rows))
        self.border_title = self._text("preview_page.program", strategy=self._shown[1].value)
        self.border_subtitle = self._text("preview_page.rows", first=self._first + 1, last=last, all=len(rows))
        self.show(rows[self._first : last])
