"""No message that tells somebody to act is cut at 80 x 24: every sentence of both catalogues, in its row or panel.

What is walked is what stands in the catalogues, so that a new sentence is walked without being added here."""

from __future__ import annotations

import string
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from console.session.cut.interlocks import Interlock
from console.session.learning.part_learning import PartLearning
from console.session.station.alarms import Alarm, Priority
from console.session.station.state import Activity, StationState, StopState
from console.text.catalogue import LANGUAGES, Catalogue, load
from console.tui.frame import LEAST_BODY, ROWS, Frame, alarm_row, frame_rows, next_row, stop_row
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import (
    BLANK,
    Line,
    clip_lines,
    fact,
    find_changed_cells,
    fit_text,
    hanging,
    justify_line,
    line,
    name_among,
    name_in,
    plain_text,
    to_strip,
    width_of,
    wrap_line,
)
from console.tui.list_panel import message_lines
from console.tui.pages import preview_lines, setup_lines
from console.tui.pages.fields import FORM, judge, name_field, name_problem
from console.tui.pages.learn_lines import reason_lines
from console.tui.pages.run_lines import check_lines
from console.tui.pages.setup_lines import FormState, form
from console.tui.pages.stop_lines import lost_lines, stop_lines
from console.tui.theme import COLOUR, Token
from profiles.findings import Finding, Severity
from profiles.problem import Problem
from tests.tui import run_stage
from tests.tui.run_stage import MADE, state
from tests.tui.stage import experiment
from tests.tui.test_frame_rows import READY, STOPPED, frame

COLUMNS, TERMINAL_ROWS = 80, 24

# As long as they get: a serial line by its name, a setting, a reason of the operating system, all the strategies.
LONG = {
    "where": "serial:/dev/serial/by-id/usb-FTDI_FT232R_USB_UART_A10KZP45-if00-port0?baud=115200",
    "key": "tool.encoder_acceleration_limit_m_per_s2",
    "value": "[Errno 13] Permission denied: lee-2001-experiment-1-second-clamping.toml",
    "limit": "pvt, cam, timebase, paper, none; > 0.000 mm and <= 12345.678 mm (of 130.000 mm)",
}
OTHER = "12345.678 mm"
ALARMS = 12


@cache
def sentences(language: str) -> dict[str, str]:
    return load(language)._entries  # type: ignore[return-value]


def problems(language: str) -> list[Problem]:
    """Every problem that has a sentence, with all of its fields as long as they get."""
    codes = [key.removeprefix("problem.") for key in sentences(language) if key.startswith("problem.")]
    assert len(codes) > 400
    return [Problem(code=code, **LONG) for code in codes]


def filled(language: str) -> Iterator[str]:
    """Every other sentence, with long values."""
    for key, entry in sentences(language).items():
        if not key.startswith("problem."):
            fields = [(name, form) for _, name, form, _ in string.Formatter().parse(entry) if name]
            values = {name: 12345.678 if form else LONG.get(name, OTHER) for name, form in fields}
            yield load(language)(key, **values)


def letters(lines: Sequence[Line], without: str = "") -> str:
    """What is written, without the blanks that lines are broken at, and without what stands beside it."""
    text = plain_text(lines)
    assert without in text.split("\n")[0]
    return "".join(text.replace(without, "", 1).split())


def one_word(text: str) -> str:
    return "".join(text.split())


def alarmed(problem: Problem, *, acknowledged: bool = False) -> StationState:
    """One alarm in front of eleven others: nobody has seen any of them, or all were seen."""
    others = tuple(
        Alarm(problem=Problem(code="link.lost"), priority=Priority.LOW, at_s=2.0 + n, acknowledged=acknowledged)
        for n in range(ALARMS - 1)
    )
    return replace(
        READY,
        alarms=(Alarm(problem=problem, priority=Priority.HIGH, at_s=1.0, acknowledged=acknowledged), *others),
    )


def fits(now: Frame) -> dict[str, list[Line]]:
    """The rows, which leave the page its least room, and none of which is too wide."""
    rows = frame_rows(now, COLUMNS, TERMINAL_ROWS)
    assert list(rows) == list(ROWS)
    assert sum(len(lines) for lines in rows.values()) <= TERMINAL_ROWS - LEAST_BODY
    assert all(width_of(each) <= COLUMNS for lines in rows.values() for each in lines)
    return rows


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_problem_is_whole_as_an_alarm_and_as_an_answer(language: str) -> None:
    text = load(language)
    count, shown = f"({ALARMS})", text("frame.all")
    acknowledge = f"{text('frame.acknowledge', count=ALARMS)} {shown}"
    for problem in problems(language):
        sentence = one_word(text.problem(problem))
        unseen, seen = alarmed(problem), alarmed(problem, acknowledged=True)
        assert letters(fits(frame(unseen, language))["alarm"], acknowledge) == f"!!!{sentence}"
        assert letters(fits(frame(seen, language))["alarm"], f"{count} {shown}") == f"!!!{sentence}"
        answer = one_word(text.problem(name_field(problem, text)))
        alone, others = (problem,), (problem, problem, problem)
        assert letters(fits(frame(READY, language, said=alone))["alarm"]) == f"–{answer}"
        assert letters(fits(frame(replace(READY, refusals=alone), language))["alarm"]) == f"–{answer}"
        assert letters(fits(frame(READY, language, said=others))["alarm"], f"+2 {shown}") == f"–{answer}"
        below = fits(frame(alarmed(Problem(code="link.lost")), language, said=others))
        assert letters(below["next"], f"+2 {shown}") == f"–{answer}"


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_other_sentence_is_whole_as_the_next_step(language: str) -> None:
    for sentence in filled(language):
        now = frame(READY, language, next_step=line((sentence, Token.ACTION)))
        assert letters(fits(now)["next"]) == f"▶{one_word(sentence)}"


@pytest.mark.parametrize("language", LANGUAGES)
def test_beside_the_longest_alarm_an_answer_is_whole_or_says_what_shows_it(language: str) -> None:
    text = load(language)
    each = sorted(problems(language), key=lambda problem: cell_len(text.problem(problem)))
    alarm = each[-1]
    count = f"{text('frame.acknowledge', count=ALARMS)} {text('frame.all')}"
    whole = []
    for answer in each:
        rows = fits(frame(alarmed(alarm), language, said=(answer,)))
        assert letters(rows["alarm"], count) == f"!!!{one_word(text.problem(alarm))}"
        whole.append(letters(rows["next"]) == f"–{one_word(text.problem(name_field(answer, text)))}")
        assert whole[-1] or plain_text(rows["next"][-1:]) == text("panel.more")
    assert all(whole[: len(each) // 3])
    assert not whole[-1]


UNDELIVERED = replace(STOPPED, stop=StopState(reason="space", killed=False, sent_s=1.0, delivered=False))
OF_THE_STOP_ROW = {
    "frame.not_delivered": UNDELIVERED,
    "frame.not_known": replace(READY, activity=Activity.LOST),
    "frame.stop_sent": replace(STOPPED, stop=StopState(reason="f9", killed=True, sent_s=1.0)),
    "frame.at_rest_after": STOPPED,
    "frame.at_rest_seen": replace(STOPPED, stop=replace(STOPPED.stop, still_s=10.2)),  # type: ignore[type-var]
    "frame.spindle_needs": run_stage.cutting(),
    "frame.moving": replace(run_stage.cutting(), activity=Activity.HOMING),
    "frame.at_rest": READY,
}


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("key", OF_THE_STOP_ROW)
def test_what_stands_beside_the_stop_key_is_whole_and_the_key_in_its_place(key: str, language: str) -> None:
    text = load(language)
    facts = {
        "frame.at_rest_after": {"seconds": "0.6", "how": text("frame.by_ramp")},
        "frame.at_rest_seen": {"seconds": "0.2", "proven": "0.6", "how": text("frame.by_ramp")},
    }.get(key, {"seconds": "0.3"})
    for field, width in product((FieldKind.NONE, FieldKind.TEXT), (60, COLUMNS, 160)):
        now = frame(OF_THE_STOP_ROW[key], language, field=field)
        *above, last = rows = stop_row(now, width)
        stop = text("frame.stop") if field is FieldKind.NONE else text("frame.stop_in_text")
        assert plain_text([last]).startswith(f" {stop} "), (field, width)
        assert letters([*above, (("", Token.TEXT), *last[1:])]) == one_word(text(key, **facts)), (field, width)
        assert {width_of(each) for each in rows} == {width}
        assert width < COLUMNS or above == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_no_terminal_has_room_for_goes_on_in_the_list(language: str) -> None:
    """The stop key and the keys stay where they are, however long a message is."""
    text = load(language)
    endless = Problem(code="session.fault", value="lathe " * 700)
    now = frame(alarmed(endless), language, said=(endless,))
    rows = frame_rows(now, COLUMNS, TERMINAL_ROWS)
    assert sum(len(lines) for lines in rows.values()) == TERMINAL_ROWS - LEAST_BODY
    assert (len(rows["state"]), len(rows["stop"]), len(rows["keys"])) == (1, 1, 1)
    assert plain_text(rows["alarm"][-1:]) == text("panel.more")
    assert letters(message_lines(now, (), COLUMNS)).count("lathe") == 2 * 700


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_list_has_every_message_in_full(language: str) -> None:
    text, each = load(language), problems(language)
    alarms = tuple(Alarm(problem=problem, priority=Priority.HIGH, at_s=1.0) for problem in each)
    rows = message_lines(frame(replace(READY, alarms=alarms), language, said=tuple(each)), (), COLUMNS)
    assert all(width_of(row) <= COLUMNS for row in rows)
    shown = letters(rows)
    for problem in each:
        assert f"!!!{one_word(text.problem(problem))}" in shown
        assert f"–{one_word(text.problem(name_field(problem, text)))}" in shown


# The panels of the pages at 80 x 24: the sentence is there, or the last row says that w shows the rest of it.

Panel = Callable[[Problem, Catalogue, int, int | None], list[Line]]
REFUSED = Severity.REFUSAL


def of_run(problem: Problem, text: Catalogue, width: int, height: int | None) -> list[Line]:
    return check_lines(
        text, (Interlock(name="no_stop"), Interlock(name="job", problems=(problem,))), width, height
    )


def of_setup(problem: Problem, text: Catalogue, width: int, height: int | None) -> list[Line]:
    return setup_lines.finding_lines([Finding(severity=REFUSED, problem=problem)], text, width, height)


def of_preview(problem: Problem, text: Catalogue, width: int, height: int | None) -> list[Line]:
    return preview_lines.finding_lines([Finding(severity=REFUSED, problem=problem)], text, width)


def of_inspect(problem: Problem, text: Catalogue, width: int, height: int | None) -> list[Line]:
    return reason_lines(PartLearning(made=MADE, problems=(problem,)), text, width)


PANELS: dict[str, tuple[Panel, int, int | None]] = {
    "run": (of_run, 39, 16),
    "set-up": (of_setup, 29, 7),
    "preview": (of_preview, 34, None),
    "inspect": (of_inspect, 78, None),
}


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", PANELS)
def test_a_panel_has_the_sentence_or_says_what_shows_it(name: str, language: str) -> None:
    panel, width, height = PANELS[name]
    text = load(language)
    cut = 0
    for problem in problems(language):
        sentence = one_word(text.problem(name_field(problem, text)))
        sentences_ = (sentence, one_word(text.problem(problem)))
        rows = panel(problem, text, width, height)
        assert all(width_of(row) <= width for row in rows)
        if not any(each in letters(rows) for each in sentences_):
            cut += 1
            assert height is not None and len(rows) == height
            assert plain_text(rows[-1:]) == text("panel.more")
        assert any(each in letters(panel(problem, text, COLUMNS - 2, None)) for each in sentences_)
    assert (cut > 0) is (height is not None), "the fields are too short to try what has no room"


@pytest.mark.parametrize("language", LANGUAGES)
def test_under_the_form_every_refusal_of_an_entry_is_whole(language: str) -> None:
    """Each value of the form with what nobody may type, and each name under which nothing is saved."""
    text, work = load(language), experiment()
    refused = 0
    for place, field in enumerate(FORM):
        for typed in ("1,200", "-999999.123", "99999999999.25", "1.2.3", "x" * 24):
            judged = judge(work, field, typed, text.units)
            entered = FormState(work=work, selected=place, typed=typed, judged=judged)
            rows = form(entered, text, 47, 16)
            assert rows.entry is not None and "[" in plain_text([rows.lines[rows.entry[1]]])
            for problem in judged.problems[:1]:
                refused += 1
                assert one_word(text.problem(name_field(problem, text))) in letters(rows.lines)
    assert refused > 30
    taken = frozenset({"lee-2001-experiment-1-second-clamping-in-the-other-chuck"})
    for name in (*taken, "a/b", "x" * 61):
        unfit = name_problem(name, taken)
        assert unfit is not None
        naming = FormState(work=work, naming=name, naming_problem=unfit)
        assert one_word(text.problem(unfit)) in letters(form(naming, text, 47, 16).lines)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("height", [16, 10, 8])
@pytest.mark.parametrize("name", [name for name, each in run_stage.STATES.items() if each.stop is not None])
def test_after_a_stop_what_to_do_is_on_the_page_in_full(name: str, height: int, language: str) -> None:
    """Also where messages have taken half of the page; the figures of the stop give way."""
    text, now = load(language), run_stage.STATES[name]
    assert now.stop is not None
    if now.activity is Activity.LOST:
        rows = lost_lines(text, now, 100.0, 39, height)
        remedies = [text("run_page.lost.remedy")]
    else:
        rows = stop_lines(text, replace(now, spindle_rpm=1000.0), 39, height)
        remedies = [entry for key, entry in sentences(language).items() if key.startswith("run_page.remedy.")]
    assert len(rows) <= height
    assert any(one_word(remedy) in letters(rows) for remedy in remedies)
    if not now.stop.delivered:
        assert one_word(text("run_page.not_delivered")) in letters(rows)
    assert "…" not in plain_text(rows).replace(text("panel.more"), "")


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_long_name_of_the_machine_does_not_hide_what_the_machine_does(language: str) -> None:
    lost = state(
        activity=Activity.LOST,
        machine="a-lathe-with-a-name-as-long-as-a-file-may-have-it-in-the-folder-of-machines",
    )
    shown = plain_text(ROWS["state"](frame(lost, language), COLUMNS))
    assert load(language)("activity.lost") in shown and "a-lathe" in shown


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_was_cut_at_80_columns_has_now_the_lines_that_it_needs(language: str) -> None:
    """The walk can fail: most sentences with long values are longer than a row."""
    longer = [each for each in problems(language) if cell_len(load(language).problem(each)) > COLUMNS - 5]
    assert len(longer) > 300
    assert {len(alarm_row(frame(alarmed(each), language), COLUMNS)) for each in longer} >= {2, 3, 4}
    assert len(next_row(frame(READY, language, next_step=line("word " * 40)), COLUMNS)) == 3
    assert PageName.RUN is frame().page


# Lines of text: what is set to a width has that width, in cells.


words = st.text(st.sampled_from("ab c가나Ø°±·─") | st.characters(categories=["L", "N"]), max_size=30)
tokens = st.sampled_from([Token.TEXT, Token.DIM, Token.ALARM])
lines_ = st.lists(st.tuples(words, tokens), max_size=5).map(tuple)


@given(words, st.integers(0, 40))
def test_a_fitted_text_has_its_width(text: str, width: int) -> None:
    assert cell_len(fit_text(text, width)) == width


@given(words, st.integers(4, 40))
def test_a_text_that_is_cut_says_so(text: str, width: int) -> None:
    if cell_len(text) > width:
        assert "…" in fit_text(text, width)


@given(words, st.integers(0, 40))
def test_a_long_name_keeps_its_beginning_and_its_end(text: str, width: int) -> None:
    short = name_in(text, width)
    assert cell_len(short) <= width
    if cell_len(text) <= width:
        assert short == text
    elif width >= 4:
        head, _, tail = short.partition("…")
        assert text.startswith(head) and text.endswith(tail)


def test_names_of_a_family_stay_apart() -> None:
    assert name_in("lee-2001-experiment-1", 16) != name_in("lee-2001-experiment-2", 16)


ALIKE = tuple(
    f"customer-4711-{size}bearing-ring-outer-{side}-side-op20-jaws-3-rev-{letter}"
    for size in ("", "very-long-")
    for side in ("left", "right")
    for letter in "ab"
)


def test_long_names_that_differ_anywhere_are_told_apart() -> None:
    for width in (28, 32, 46):
        shown = [name_among(name, ALIKE, width) for name in ALIKE]
        assert len(set(shown)) == len(ALIKE), (width, shown)
        assert all(cell_len(each) <= width for each in shown)


@given(words, st.lists(words, max_size=4).map(tuple), st.integers(1, 40))
def test_a_name_among_others_fits_and_is_itself_where_there_is_room(
    name: str, others: tuple[str, ...], width: int
) -> None:
    short = name_among(name, others, width)
    assert cell_len(short) <= width
    assert short == name or cell_len(name) > width


@given(lines_, words, st.integers(30, 90))
def test_left_and_right_fill_the_row(left: tuple[tuple[str, Token], ...], right: str, width: int) -> None:
    right = fit_text(right, min(cell_len(right), width))
    assert width_of(justify_line(left, line(right), width)) == width


@given(words, words, st.integers(20, 60))
def test_a_fact_fills_its_row_and_its_value_stands_right(label: str, value: str, width: int) -> None:
    pieces = fact(label, value, width, label_width=10)
    assert width_of(pieces) == width
    assert pieces[-1][0].endswith(value) or cell_len(value) > width - 10


@given(words, st.integers(2, 30))
def test_wrapping_loses_no_letter_and_no_row_is_too_wide(text: str, width: int) -> None:
    rows = wrap_line(text, width)
    assert "".join("".join(t for t, _ in row) for row in rows).replace(" ", "") == "".join(text.split())
    assert all(width_of(row) <= width for row in rows)


@given(words, st.integers(12, 40), st.sampled_from([BLANK, line("(3)"), line("가나 w")]))
def test_a_text_behind_its_mark_loses_no_letter_and_what_stands_beside_it_ends_its_first_row(
    text: str, width: int, beside: Line
) -> None:
    rows = hanging((" ! ", Token.ALARM), text, width, beside=beside)
    assert all(width_of(row) <= width for row in rows)
    assert all(plain_text([row]).startswith("   ") for row in rows[1:])
    first = plain_text(rows[:1])
    assert first.startswith(" !") and first.endswith(plain_text([beside]))
    said = first.removesuffix(plain_text([beside])) + plain_text(rows[1:])
    assert "".join(said.split()) == "!" + "".join(text.split())


@given(st.lists(st.just(line("row")), max_size=9), st.integers(0, 9))
def test_rows_without_room_end_with_what_shows_them(rows: list[Line], height: int) -> None:
    shown = clip_lines(rows, height, "more")
    assert len(shown) == min(len(rows), height)
    assert (plain_text(shown[-1:]) == "more") is (len(rows) > height > 0)


@given(lines_, st.integers(1, 60))
def test_a_strip_is_as_wide_as_its_place_and_has_a_style_everywhere(
    pieces: tuple[tuple[str, Token], ...], width: int
) -> None:
    strip = to_strip(pieces, width, COLOUR)
    assert strip.cell_length == width
    assert all(segment.style is not None for segment in strip)


@given(lines_, lines_)
def test_outside_of_the_changed_cells_nothing_changes(
    before: tuple[tuple[str, Token], ...], after: tuple[tuple[str, Token], ...]
) -> None:
    first, end = find_changed_cells(before, after)
    old, new = (to_strip(pieces, 200, COLOUR) for pieces in (before, after))
    assert old.crop(0, first).text == new.crop(0, first).text
    assert old.crop(end, 200).text == new.crop(end, 200).text
    if before == after:
        assert (first, end) == (0, 0)
