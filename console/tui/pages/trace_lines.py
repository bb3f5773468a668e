"""Text of the trace chooser: the files of the gauge, and the header of the selected one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from console.session.cut.run import FILTER_UPR
from console.session.data.measured_part import CutPart
from console.session.learning.evaluated_part import OF_FORM, QUESTIONS, EvaluatedPart
from console.text.catalogue import Catalogue
from console.text.part_sentences import at_height, extraction_words, place_words
from console.tui.lines import BLANK, NOTHING, Line, dim, fit_text, hanging, justify_line, line, name_in, wrap_line
from console.tui.pages.learn_lines import part_words
from console.tui.rows import problem_lines
from console.tui.theme import Token
from profiles.files import printable
from profiles.metrology.cylindricity import MINIMUM_ZONE
from profiles.problem import Problem

KEYS = {"state": "s", "direction": "d", "start_mark": "j", "z_from": "e"}
"""Key that steps through the answers to each question."""

_DATE_CELLS = 12
_LABEL_CELLS = 14


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What the chooser shows: the files once they are `listed`, and when they were changed.

    `together` are the marked files, each with sections of one part. `found` is the trace of them, or else of the
    selected file, or why it cannot be read; None: not yet.
    `part` is the part in the record that a trace is taken for, None where it is the one in the chuck (`in_chuck`)
    or there is none. `turned`: the trace is of the last part, turned on its gauge.
    """

    folder: Path
    listed: bool = False
    files: tuple[Path, ...] = ()
    dates_ns: Mapping[Path, int] = field(default_factory=dict)
    selected: int = 0
    found: EvaluatedPart | tuple[Problem, ...] | None = None
    answers: Mapping[str, str] = field(default_factory=dict)
    together: frozenset[Path] = frozenset()
    part: CutPart | None = None
    in_chuck: bool = False
    turned: bool = False

    @property
    def file(self) -> Path | None:
        """The selected file."""
        return self.files[self.selected] if self.files else None

    @property
    def chosen(self) -> tuple[Path, ...]:
        """The files that are read: those marked, in the order of the list, or else the selected one."""
        marked = tuple(each for each in self.files if each in self.together)
        return marked or (() if self.file is None else (self.file,))

    @property
    def ready(self) -> bool:
        """Whether Enter takes the trace."""
        known = self.in_chuck or self.part is not None
        return known and isinstance(self.found, EvaluatedPart) and self.found.ready


def file_lines(choice: Choice, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the list of files, newest first, around the selected one; or where to put them."""
    where = wrap_line(text("trace_import.folder", folder=printable(str(choice.folder))), width, Token.DIM)
    if not choice.listed:
        return [line(dim(text("trace_import.listing"))), BLANK, *where]
    if not choice.files:
        return [*wrap_line(text("trace_import.none"), width), BLANK, *where]
    room = max(height - len(where) - 1, 1)
    first = min(max(choice.selected - room // 2, 0), max(len(choice.files) - room, 0))
    rows = [
        _file_row(path, choice.dates_ns.get(path, 0), place == choice.selected, path in choice.together, width)
        for place, path in enumerate(choice.files[first : first + room], start=first)
    ]
    return [*rows, BLANK, *where]


def fact_lines(choice: Choice, text: Catalogue, width: int) -> list[Line]:
    """Return the selected trace, the part it would be taken for, and the open questions."""
    if not choice.listed:
        return []
    rows = _part_lines(choice, text, width)
    if choice.file is None:
        return rows
    found = choice.found
    if found is None:
        return [*rows, BLANK, line(dim(text("trace_import.reading")))]
    if not isinstance(found, EvaluatedPart):
        return [*rows, BLANK, *problem_lines(found, text, width, token=Token.WARNING)]
    rows += [BLANK, _row(text("trace_import.points"), str(found.trace.angle_deg.size), width)]
    if len(filed := found.sections) > 1:
        first, last = (text.units.figure(filed[place].z_mm or 0.0, "mm", 1) for place in (0, -1))
        among = text("trace_import.among", count=len(filed), first=first, last=last)
        rows.append(_row(text("trace_import.sections"), among, width, Token.STRONG))
    of_form = [_stated_row(found, key, text, width) for key in OF_FORM]
    rows += _section_rows(found, text, width) if filed else of_form
    if found.whole is not None:
        if found.whole.sections:
            worst = text.units.show(found.whole.worst.ront_um, "um", 2) + place_words(found.whole.worst.z_mm, text)
            rows.append(_row(text("trace_import.worst"), worst, width, Token.STRONG))
        cylt_um = found.whole.cylinder(MINIMUM_ZONE).cylt_um
        rows.append(_row("CYLt MZCY", text.units.show(cylt_um, "um", 2), width, Token.STRONG))
    rows += problem_lines((*found.problems, *_warnings(found)), text, width, token=Token.WARNING)
    if found.whole is not None:
        for words in extraction_words(found.whole, found.trace.meta, text):
            rows += wrap_line(words, width, Token.DIM)
    return rows


def _section_rows(found: EvaluatedPart, text: Catalogue, width: int) -> list[Line]:
    """Return how the sections were measured, and the roundness of the one that is judged."""
    heights = found.section_z_mm is not None
    turns = found.header.turns
    rows = [_row(text("trace_import.turns"), str(turns), width)] if turns > 1 else []
    rows += [_stated_row(found, key, text, width) for key in QUESTIONS if key != "z_from" or heights]
    circle = text("trace_import.judged_by", upr=f"{FILTER_UPR:g}")
    rows.append(_row(text("trace_import.circle"), circle, width))
    ront = NOTHING if found.judged is None else text.units.show(found.judged.ront_um, "um", 2)
    rows.append(_row("RONt", ront, width, Token.STRONG))
    known = "z_from" not in found.open
    return [*rows, *(wrap_line(at_height(found.section_z_mm, text), width) if known else ())]


def next_words(choice: Choice, text: Catalogue) -> str:
    """Return what to do in the chooser."""
    found = choice.found
    if not choice.listed:
        return text("trace_import.next.listing")
    if choice.file is None:
        return text("trace_import.next.none")
    if not choice.in_chuck and choice.part is None:
        return text("trace_import.next.no_part")
    if found is None:
        return text("trace_import.next.reading")
    if not isinstance(found, EvaluatedPart) or found.problems:
        return text("trace_import.next.refused")
    if found.open:
        return text("trace_import.next.answer", keys=", ".join(KEYS[key] for key in found.open))
    return text("trace_import.next.take_turned" if choice.turned else "trace_import.next.take")


def _part_lines(choice: Choice, text: Catalogue, width: int) -> list[Line]:
    if choice.in_chuck:
        return wrap_line(text("trace_import.part.in_chuck"), width)
    if choice.part is None:
        return wrap_line(text("trace_import.part.none"), width, Token.WARNING)
    at, made = _local(choice.part.at_utc), choice.part.made
    rows = wrap_line(text("trace_import.part.recorded", at=at, made=part_words(text, made)), width)
    if choice.part.cut_since:
        rows += hanging(("! ", Token.WARNING), text("trace_import.part.cut_since"), width, Token.WARNING)
    return rows


def _file_row(path: Path, changed_ns: int, selected: bool, together: bool, width: int) -> Line:
    mark, token = ("▸", Token.STRONG) if selected else (" ", Token.TEXT)
    mark += "+" if together else " "
    name = name_in(printable(path.name), max(width - len(mark) - _DATE_CELLS - 1, 1))
    return justify_line(line((mark + name, token)), line(dim(f" {_date(changed_ns)}")), width)


def _date(changed_ns: int) -> str:
    try:
        return datetime.fromtimestamp(changed_ns / 1e9).strftime("%m-%d %H:%M") if changed_ns else NOTHING
    except (OSError, OverflowError, ValueError):
        return NOTHING


def _local(at_utc: str) -> str:
    try:
        return datetime.fromisoformat(at_utc).astimezone().strftime("%Y-%m-%d %H:%M")
    except (OverflowError, ValueError):
        return printable(at_utc, 20)


def _row(label: str, value: str, width: int, token: Token = Token.TEXT) -> Line:
    return line(
        dim(fit_text(label, _LABEL_CELLS)), (fit_text(value, max(width - _LABEL_CELLS, 0)).rstrip(), token)
    )


def _stated_row(found: EvaluatedPart, key: str, text: Catalogue, width: int) -> Line:
    """Return a header key with its value; an unstated one with the key that answers it."""
    label = text(f"trace_import.{key}")
    value = _format_header_value(found, key, text)
    if key not in found.asked:
        return _row(label, value, width)
    if key in found.open:
        return _row(label, text("trace_import.unanswered", key=KEYS[key]), width, Token.WARNING)
    return _row(label, text("trace_import.answered", value=value, key=KEYS[key]), width, Token.ACTION)


def _format_header_value(found: EvaluatedPart, key: str, text: Catalogue) -> str:
    header = found.header
    if key == "start_mark" and header.jaw_1_deg:
        return text("inspect_page.jaw", angle=f"{header.jaw_1_deg:g}")
    value = getattr(header, key)
    if value is None:
        return NOTHING
    if value in QUESTIONS[key]:
        return text(f"trace_import.{key}.{value.replace(' ', '_')}")
    return printable(str(value), 40)


def _warnings(found: EvaluatedPart) -> tuple[Problem, ...]:
    return found.warnings if found.judged is None else (*found.judged.warnings, *found.warnings)
