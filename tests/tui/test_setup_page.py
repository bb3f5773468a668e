"""Set-up: values are judged as they are typed, locked while they matter, and nothing that was typed is lost."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from rich.cells import cell_len

from console.session.data.kept_files import jobs_folder
from console.session.station.state import Activity, StationState
from console.session.work import edit_field
from console.text.catalogue import load
from console.tui.gate import FieldKind
from console.tui.lines import plain_text, width_of
from console.tui.pages.fields import (
    FORM,
    bounds,
    format_field,
    free_name,
    judge,
    name_field,
    name_problem,
    with_unit,
)
from console.tui.pages.setup import SetupPage
from console.tui.pages.setup_lines import finding_lines, speed_lines
from console.units import METRIC
from profiles.findings import Severity
from profiles.rules import check
from profiles.store import load_job
from tests.tui.page_stage import READY, PageScene, on_page
from tests.tui.stage import FRAME_ROWS, LANGUAGES, SIZES, experiment

ROOMS = [(width, height - FRAME_ROWS) for width, height in (*SIZES, (60, 18))]
FORCE = next(place for place, field in enumerate(FORM) if field.key == "chucking_force_n")


class Stage(PageScene):
    """The page, with the keys that the gate would let through."""

    page_class = SetupPage

    async def type(self, text: str) -> None:
        await self.pilot.press(*text)
        await self.pilot.pause()

    def kind(self) -> FieldKind:
        return self.page.field


play = partial(on_page, Stage)


@pytest.mark.first(4)
@pytest.mark.parametrize("size", ROOMS)
@pytest.mark.parametrize("language", LANGUAGES)
async def test_the_values_stand_in_the_room_with_their_units(
    size: tuple[int, int], language: str, tmp_path: Path
) -> None:
    async with play(tmp_path, work=experiment(), language=language, size=size) as stage:
        rows = stage.text.splitlines()
        assert all(cell_len(row) <= size[0] for row in rows)
        assert len(rows) <= size[1]
        assert "D 52.000  mm" in stage.text
        assert "1314.0  N" in stage.text
        assert "645.7 N" in stage.text
        # VDI 3106 and the 1970 N at which 5 % of scatter are 5 um of 55; 1314 N / 377 N/(N m), and 5 % of them.
        assert "621 … 1970 N" in stage.text
        assert "3.49 N m ±66 N" in stage.text
        # The smallest room has a row: how much there is to be minded.
        hold = stage.ui.text("setup.hold", count=22, total=22)[:10]
        assert (hold if size != ROOMS[-1] else "…") in stage.text


async def test_the_grip_at_speed_is_that_of_the_standard(tmp_path: Path) -> None:
    """VDI 3106 by hand: F_sp0 / S_sp less the sum of m r omega^2 over the jaws."""
    work = experiment()
    chuck = work.machine.machine.chuck
    omega = 1000.0 * 2.0 * 3.141592653589793 / 60.0
    loss_n = 3 * chuck.jaw_mass_kg * chuck.jaw_radius_mm / 1000.0 * omega**2
    async with play(tmp_path, work=work) as stage:
        assert f"{loss_n:.1f} N" in stage.text
        assert f"{1314.0 / chuck.safety_factor - loss_n:.1f} N" in stage.text
        assert "50.0 Hz" in stage.text


async def test_without_a_job_the_way_to_one_is_shown(tmp_path: Path) -> None:
    async with play(tmp_path) as stage:
        assert "No job is open" in stage.text
        await stage.act("setup.edit", "setup.next", "setup.save_as", "setup.undo")
        assert stage.kind() is FieldKind.NONE
        assert stage.codes == ["screen.no_job"]
        assert "1" in stage.next_step


async def test_a_typed_value_is_judged_while_it_is_typed_and_counts_when_it_is_taken(tmp_path: Path) -> None:
    async with play(tmp_path, work=experiment()) as stage:
        await stage.act(*["setup.next"] * FORCE)
        for typed, said in (
            ("400", "✗ below window"),
            ("1970", "force window ✓"),
            ("621", "force window ✓"),
            ("1971", "✗ above window"),
            ("1400", "! force, total = 1400 N, but"),
            ("1400", "21 of 22 rules passed"),
            ("7000", "✗ force, total = 7000 N"),
            ("", "keeps 1314.0 N"),
        ):
            await stage.act("setup.edit")
            assert stage.kind() is FieldKind.NUMBER
            await (stage.type(typed) if typed else stage.pilot.press("delete"))
            await stage.show()
            assert said in stage.text
            assert stage.ui.work is not None and stage.ui.work.job.chucking_force_n == 1314.0
            await stage.pilot.press(*["delete", "backspace"] * 4)
            await stage.act("setup.edit")
            assert stage.kind() is FieldKind.NONE and not stage.ui.work.edited, "an empty entry keeps the value"
        await stage.act("setup.edit")
        await stage.type("7000")
        assert "= 7000.0" in stage.text
        await stage.act("setup.edit")
        assert stage.ui.work is not None and stage.ui.work.job.chucking_force_n == 7000.0
        assert (
            stage.kind() is FieldKind.NONE
            and "edited, not saved" in stage.text
            and "2 rules refuse" in stage.next_step
        )


def test_a_force_without_a_torque_says_so_and_a_chuck_without_a_line_says_nothing() -> None:
    work = experiment()
    machine, chuck = work.machine.machine, work.machine.machine.chuck
    words = {}
    for offset_n, slope in ((1400.0, 377.0), (None, None)):
        known = replace(chuck, force_offset_n=offset_n, force_per_torque_n_per_n_m=slope)
        words[slope] = plain_text(speed_lines(work.job, replace(machine, chuck=known), load("en"), 29, 7))
    assert "no such torque" in words[377.0]
    assert "wrench" not in words[None]


@pytest.mark.parametrize("language", LANGUAGES)
async def test_what_does_not_parse_is_not_taken_and_not_lost(language: str, tmp_path: Path) -> None:
    """A letter in a number refuses the entry, and is not left out of it."""
    async with play(tmp_path, work=experiment(), language=language) as stage:
        await stage.act(*["setup.next"] * FORCE, "setup.edit")
        for typed, code in (
            ("1,314", "value.ambiguous"),
            ("0", "value.out_of_range"),
            *((each, "value.not_number") for each in ("-", "1a2e3", "1e3", "1e3x7", "13!")),
        ):
            await stage.pilot.press("home", *["delete"] * 8)
            await stage.type(typed)
            assert "✗ " + stage.ui.text("setup.refused") in stage.text
            for ending in ("setup.edit", "setup.next", "setup.previous", "setup.save_as"):
                stage.ui.key_answer = ()
                await stage.act(ending)
                assert stage.codes == [code] and stage.kind() is FieldKind.NUMBER
                assert f"[{typed} " in stage.text
            assert code != "value.not_number" or stage.ui.key_answer[0].value == f'"{typed}"'
        assert stage.ui.work == experiment()


async def test_keys_that_come_in_one_piece_are_all_in_the_value(tmp_path: Path) -> None:
    """A slow line delivers the digits and Enter at once; no digit may come after the end of the entry."""
    async with play(tmp_path, work=experiment()) as stage:
        await stage.act(*["setup.next"] * FORCE, "setup.edit")
        from textual.events import Key

        for character in "1350":
            stage.app.focused.post_message(Key(character, character))  # type: ignore[union-attr]
        stage.page.act("setup.edit")
        await stage.pilot.pause()
        assert stage.ui.work is not None
        assert stage.ui.work.job.chucking_force_n == 1350.0


async def test_tab_takes_the_value_and_opens_the_next_one_and_ends_behind_the_last(tmp_path: Path) -> None:
    async with play(tmp_path, work=experiment()) as stage:
        assert "a material of at most 80 characters" in stage.text
        await stage.act("setup.edit")
        assert stage.kind() is FieldKind.TEXT
        await stage.type("Steel 45")
        await stage.act("setup.next")
        assert stage.kind() is FieldKind.NUMBER
        await stage.type("60,5")
        await stage.act("setup.edit")
        assert stage.ui.work is not None
        assert (stage.ui.work.job.material, stage.ui.work.job.diameter_mm) == ("Steel 45", 60.5)
        await stage.act("setup.undo")
        assert stage.ui.work.job.diameter_mm == 52.0
        await stage.act("setup.undo")
        assert not stage.ui.work.edited
        await stage.act("setup.undo")
        assert stage.codes == ["screen.nothing_to_undo"]
        await stage.act(*["setup.next"] * 20, "setup.previous", "setup.edit")
        await stage.type("4")
        await stage.act("setup.next")
        assert stage.kind() is FieldKind.NONE
        assert stage.ui.work.job.diameter_tolerance_um == 4.0


@pytest.mark.parametrize(
    ("typed", "force_n", "codes"), [("1350", 1350.0, []), ("1,350", 1314.0, ["screen.entry_dropped"])]
)
async def test_leaving_takes_a_good_value_and_says_which_one_it_drops(
    typed: str, force_n: float, codes: list[str], tmp_path: Path
) -> None:
    async with play(tmp_path, work=experiment()) as stage:
        await stage.act(*["setup.next"] * FORCE, "setup.edit")
        await stage.type(typed)
        stage.page.leave()
        assert stage.kind() is FieldKind.NONE
        assert stage.ui.work is not None
        assert stage.ui.work.job.chucking_force_n == force_n
        assert stage.codes == codes


def armed() -> Any:
    return object()


@pytest.mark.parametrize(
    ("state", "code"),
    [
        (replace(READY, activity=Activity.CUTTING), "screen.locked_moving"),
        (replace(READY, activity=Activity.ARMING), "screen.locked_armed"),
        (replace(READY, armed=armed()), "screen.locked_armed"),
    ],
)
async def test_values_are_locked_while_they_matter(state: StationState, code: str, tmp_path: Path) -> None:
    async with play(tmp_path, work=edit_field(experiment(), "jaws", "4"), state=state) as stage:
        before = stage.ui.work
        for action in ("setup.edit", "setup.undo", "setup.save_as"):
            stage.ui.key_answer = ()
            await stage.act(action)
            assert stage.codes == [code]
            assert stage.kind() is FieldKind.NONE
        await stage.act("setup.next")
        assert stage.ui.work is before
        assert "locked" in stage.text


async def test_an_open_entry_is_dropped_when_the_machine_begins_to_move(tmp_path: Path) -> None:
    async with play(tmp_path, work=experiment()) as stage:
        await stage.act(*["setup.next"] * FORCE, "setup.edit")
        await stage.type("1350")
        stage.control.state = replace(READY, activity=Activity.HOMING)
        stage.page.show(stage.view)
        assert stage.kind() is FieldKind.NONE
        assert stage.codes == ["screen.entry_dropped"]
        assert stage.ui.work is not None
        assert not stage.ui.work.edited


@pytest.mark.parametrize(
    ("place", "typed", "beside", "below"),
    [
        (0, "steel", "lobe: Al", "lobe measured at Al, not at this value"),
        (1, "53", "lobe: D 52.000 mm", "lobe measured at D 52.000 mm, not at this"),
        (4, "6", "lobe: 3", "lobe measured at 3, not at this"),
    ],
)
async def test_a_changed_condition_of_the_measured_lobe_says_so_at_its_field(
    tmp_path: Path, place: int, typed: str, beside: str, below: str
) -> None:
    async with play(tmp_path, work=experiment(), size=ROOMS[-2]) as stage:
        assert "measured at" in stage.text
        await stage.act(*["setup.next"] * place, "setup.edit")
        await stage.type(typed)
        assert below in stage.text
        await stage.act("setup.edit")
        assert below in stage.text
        assert "other cut at" in stage.text and "measured at  " not in stage.text
        await stage.act("setup.next")
        assert beside in stage.text
        await stage.act("setup.undo")
        assert "measured at" in stage.text and beside not in stage.text


async def test_save_as_offers_a_free_name_and_opens_what_it_saved(tmp_path: Path) -> None:
    async with play(tmp_path, work=edit_field(experiment(), "jaws", "4")) as stage:
        await stage.act("setup.save_as")
        assert stage.kind() is FieldKind.TEXT
        assert "[lee-2001-experiment-1-2 " in stage.text
        await stage.type("lee-2001-experiment-1")
        await stage.act("setup.edit")
        assert stage.codes == ["screen.name_taken"]
        assert stage.ui.key_answer[0].limit == "lee-2001-experiment-1-2"
        await stage.pilot.press("home", *["delete"] * 40)
        await stage.pilot.press("m", "y", "space", "r")
        await stage.act("setup.edit")
        assert stage.kind() is FieldKind.NONE
        assert stage.ui.work is not None
        assert stage.ui.work.loaded == load_job("my r", jobs_folder(tmp_path))
        assert stage.ui.work.job.name == "my r"
        assert stage.ui.work.job.jaws == 4


async def test_nothing_is_saved_without_a_name_and_a_disk_that_refuses_is_said(tmp_path: Path) -> None:
    async with play(tmp_path, work=experiment()) as stage:
        await stage.act("setup.save_as")
        await stage.pilot.press("delete")
        await stage.act("setup.edit")
        assert stage.kind() is FieldKind.NONE
        await stage.act("setup.save_as")
        stage.page.leave()
        assert stage.codes == ["screen.not_saved"]
        assert not jobs_folder(tmp_path).exists()
        stage.ui.key_answer = ()
        await stage.act("setup.save_as")
        (tmp_path / "jobs").write_text("a file where the folder should be")
        await stage.act("setup.edit")
        assert stage.codes == ["file.not_writable"]
        assert stage.kind() is FieldKind.TEXT, "the name stays"


async def test_the_entry_lies_over_its_brackets_after_the_terminal_has_changed(tmp_path: Path) -> None:
    async with play(tmp_path, work=experiment()) as stage:
        await stage.act(*["setup.next"] * FORCE, "setup.edit")
        await stage.type("777")
        for size in ((100, 24), (60, 12), (160, 42), (80, 18)):
            await stage.pilot.resize_terminal(*size)
            stage.page.show(stage.view)
            await stage.pilot.pause()
            assert "[777       ]" in stage.text


async def test_a_page_without_room_does_not_break(tmp_path: Path) -> None:
    async with play(tmp_path, work=experiment()) as stage:
        await stage.act("setup.edit")
        for size in ((1, 1), (10, 3), (30, 5)):
            await stage.pilot.resize_terminal(*size)
            await stage.act("setup.next", "setup.save_as")


@pytest.mark.parametrize("language", LANGUAGES)
async def test_every_next_step_stands_in_its_row(language: str, tmp_path: Path) -> None:
    async with play(tmp_path, work=experiment(), language=language) as stage:

        def fits() -> bool:
            return 0 < width_of(stage.page.next_step(stage.view)) <= 78

        assert fits()
        await stage.act("setup.save_as")
        assert fits()
        await stage.pilot.press("delete")
        await stage.act("setup.edit", *["setup.next"] * FORCE, "setup.edit")
        assert fits()
        await stage.type("0")
        assert fits()
        await stage.type(".1")
        await stage.act("setup.edit")
        assert fits()


def test_rules_that_have_no_room_are_counted() -> None:
    """22 rules and 9 rows: one says how many hold, seven are named, one says how many more there are."""
    work = experiment()
    findings = [finding for finding in check(work.job, work.machine.machine) if finding.severity is Severity.OK]
    assert len(findings) == 22
    rows = plain_text(finding_lines(findings, load("en"), 40, 9)).split("\n")
    assert len(rows) == 9
    assert rows[-1].strip() == "… 15 more passed: w"
    assert "more passed" not in plain_text(finding_lines(findings, load("en"), 40, 23))


# The fields of the form: numbers are shown as they are, limits fit their cells, file names can be kept.


FIELDS = {field.key: field for field in FORM}


@pytest.mark.parametrize(
    ("value", "decimals", "shown"),
    [
        (52.0, 3, "52.000"),
        (0.05, 3, "0.050"),
        (0.0505, 3, "0.0505"),
        (1314.25, 1, "1314.25"),
        (0.00001, 3, "0.00001"),
    ],
)
def test_a_number_is_never_shown_rounded(value: float, decimals: int, shown: str) -> None:
    assert METRIC.exact(value, "N", decimals) == shown


def test_a_value_has_its_mark_and_its_unit() -> None:
    job = experiment().job
    assert with_unit(FIELDS["diameter_mm"], job, METRIC) == "D 52.000 mm"
    assert with_unit(FIELDS["chucking_force_n"], job, METRIC) == "1314.0 N"
    assert with_unit(FIELDS["jaws"], job, METRIC) == "3"


@pytest.mark.parametrize(
    ("key", "shown"),
    [("diameter_mm", ">0 ≤500"), ("chucking_force_n", ">0 ≤100000"), ("jaws", "≥2 ≤12"), ("material", "")],
)
def test_limits_stand_in_ten_cells(key: str, shown: str) -> None:
    assert bounds(FIELDS[key], METRIC) == shown
    assert len(shown) <= 10


@pytest.mark.parametrize("field", FORM, ids=lambda field: field.key)
def test_what_is_shown_can_be_typed_again(field: object) -> None:
    work = experiment()
    assert judge(work, FIELDS[field.key], format_field(FIELDS[field.key], work.job, METRIC), METRIC).work is work  # type: ignore[attr-defined]


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_refusal_calls_the_field_as_the_form_does(language: str) -> None:
    text, field = load(language), FIELDS["chucking_force_n"]
    (problem,) = judge(experiment(), field, "200000", METRIC).problems
    words = text.problem(name_field(problem, text))
    assert text("setup.chucking_force_n") in words
    assert "chucking_force_n" not in words
    assert "100000 N" in words


@pytest.mark.parametrize("name", ["ring", "ring 2", "링 가공", "a.b", "x" * 60])
def test_names_that_can_be_kept(name: str) -> None:
    assert name_problem(name, frozenset()) is None


@pytest.mark.parametrize(
    "name", ["../ring", "a/b", ".ring", "-x", "~", "ring.toml", "ring.TOML", "a\tb", "a\\b", "\udcff"]
)
def test_names_that_are_no_file_names(name: str) -> None:
    problem = name_problem(name, frozenset())
    assert problem is not None
    assert problem.code == "file.name_unfit"


def test_a_name_that_is_too_long_says_how_long_it_may_be() -> None:
    problem = name_problem("x" * 61, frozenset())
    assert problem is not None
    assert (problem.value, problem.limit) == ("61", "<= 60")


def test_a_taken_name_offers_a_free_one() -> None:
    taken = frozenset({"ring", "ring-2"})
    problem = name_problem("ring", taken)
    assert problem is not None
    assert (problem.code, problem.limit) == ("screen.name_taken", "ring-3")
    assert name_problem(free_name("ring", taken), taken) is None
    assert name_problem(free_name("가" * 60, frozenset()), frozenset()) is None
