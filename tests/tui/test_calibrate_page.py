"""The page Calibrate: which calibration counts, and points that are stored as the command does."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from console.__main__ import main
from console.session.data.calibrated_chuck import apply_calibrations
from console.session.station.state import Activity, StationState
from console.text.catalogue import load
from console.tui.calibration.chuck_facts import CalibrationStatus, ChuckFacts, kept_facts, kept_list
from console.tui.calibration.draft import Draft
from console.tui.further.calibrate import CalibratePage
from console.tui.gate import FieldKind
from console.tui.records import background_reader
from console.units import METRIC, Units
from profiles.calibration.table import CalibrationKind
from profiles.store import load_machine
from tests.tui import records_stage
from tests.tui.page_stage import PageScene, on_page
from tests.tui.records_stage import TABLE, WRENCH, keep_wrench
from tests.tui.stage import MACHINE, lathe

MOVING = StationState(activity=Activity.CUTTING)
POINTS = [line.split(";") for line in WRENCH.splitlines()[1:]]


@pytest.fixture(autouse=True)
def in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is computed is there when it is asked for, however busy this computer is."""
    monkeypatch.setattr(background_reader, "SHORT_S", 60.0)


class CalibrateScene(PageScene):
    page_class = CalibratePage

    @property
    def words(self) -> str:
        return " ".join(self.text.replace("│", " ").split())

    def field(self) -> FieldKind:
        return self.page.field

    async def enter(self, *values: str) -> None:
        for value in values:
            self.page._all.entry.value = value  # type: ignore[attr-defined]
            await self.act_on("calibrate.take")

    async def act_on(self, *actions: str) -> None:
        """Press keys as the application does: a refusal is the answer to the key."""
        for action in actions:
            with self.ui.answering():
                self.page.act(action)
            await self.pilot.pause()
            await self.show()


def kept_files(data: Path) -> list[str]:
    return sorted(path.name for path in (data / "calibrations" / MACHINE).glob("*"))


async def test_points_entered_one_by_one_are_fitted_and_stored_as_the_command_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    async with on_page(CalibrateScene, tmp_path, size=(100, 24)) as stage:
        await stage.show()
        await stage.act_on("calibrate.new")
        assert stage.field() == FieldKind.NUMBER
        for torque, force in POINTS:
            await stage.enter(torque.replace(".", ","), force)
        await stage.enter("")
        assert stage.field() == FieldKind.NONE
        assert "377.57 ± 3.39 N/(N m)" in stage.words and kept_files(tmp_path) == []
        await stage.act_on("calibrate.keep")
        assert stage.codes == ["screen.calibrate_kept"]
    calibration, points = sorted(kept_files(tmp_path), reverse=True)
    folder = tmp_path / "calibrations" / MACHINE
    record = json.loads((folder / calibration).read_text())
    assert Path(record["file"]) == folder / points
    assert main(["calibrate", "chuck", str(folder / points), "--json", "--data", str(tmp_path)]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["found"] == record["found"] and again["file_sha256"] == record["file_sha256"]
    # The next start uses it.
    machine = apply_calibrations(load_machine(MACHINE), tmp_path)
    assert machine.machine.chuck.force_per_torque_n_per_n_m == pytest.approx(377.57, abs=0.01)


@pytest.mark.parametrize("typed", ["0.00099", "0,3738", "0.374"])
async def test_kilonewtons_are_not_stored_until_their_ratio_or_value_is_typed_out(
    tmp_path: Path, typed: str
) -> None:
    async with on_page(CalibrateScene, tmp_path) as stage:
        await stage.show()
        await stage.act_on("calibrate.new")
        for torque, force in POINTS:
            await stage.enter(torque, f"{float(force) / 1010:.5f}")
        await stage.enter("")
        await stage.act_on("calibrate.keep")
        assert stage.codes == ["calibration.step"] and kept_files(tmp_path) == []
        said = load("en").problem(stage.ui.key_answer[0])
        assert "377 N/(N m)" in said and "0.3738 N/(N m)" in said and "x 0.000992; kN <> N?" in said
        assert stage.field() == FieldKind.NUMBER, "what is typed out is asked for"
        stage.ui.key_answer = ()
        await stage.enter("1")
        assert stage.codes == ["calibration.step"] and kept_files(tmp_path) == []
        stage.ui.key_answer = ()
        await stage.enter("")
        assert stage.field() == FieldKind.NONE and "not stored: 10 points" in stage.words
        await stage.act_on("calibrate.keep")
        await stage.enter(typed)
        assert stage.codes == ["screen.calibrate_kept"] and stage.field() == FieldKind.NONE
    assert len(kept_files(tmp_path)) == 2
    found = apply_calibrations(load_machine(MACHINE), tmp_path)
    assert found.machine.chuck.force_per_torque_n_per_n_m == pytest.approx(0.3738, rel=1e-3)


async def test_what_an_older_console_has_kept_in_another_unit_is_listed_as_not_used(tmp_path: Path) -> None:
    keep_wrench(tmp_path, date="2025-01-01T08:00:00.000Z")
    newer = keep_wrench(tmp_path, date="2025-01-02T08:00:00.000Z")
    record = json.loads(newer.read_text())
    record["found"]["profile"]["force_per_torque_n_per_n_m"] /= 1000.0
    newer.write_text(json.dumps(record))
    rows = kept_list(tmp_path, lathe(), "wrench")
    assert [each.standing for each in rows] == [CalibrationStatus.IMPLAUSIBLE, CalibrationStatus.NEXT_START]
    async with on_page(CalibrateScene, tmp_path, size=(100, 24)) as stage:
        await stage.show()
        assert "not plausible" in stage.words and "NOT used" in stage.words and "kN <> N" in stage.words


async def test_what_is_no_point_is_refused_and_too_few_are_not_stored_but_come_back(tmp_path: Path) -> None:
    async with on_page(CalibrateScene, tmp_path) as stage:
        await stage.show()
        await stage.act_on("calibrate.new")
        for words, code in (
            ("1,200", "value.ambiguous"),
            ("-3", "calibration.out_of_range"),
            ("10001", "calibration.out_of_range"),
            ("ten", "calibration.not_number"),
        ):
            await stage.enter(words)
            assert (stage.codes, stage.field()) == ([code], FieldKind.NUMBER), words
            stage.ui.key_answer = ()
        await stage.enter("10", "")
        assert stage.field() == FieldKind.NONE and "not stored" not in stage.words, "half a point is none"
        await stage.act_on("calibrate.new")
        await stage.enter("10", "3741", "20", "7488", "")
        assert "number of measurements: 2" in stage.words
        await stage.act_on("calibrate.keep")
        assert stage.codes == ["calibration.few_points"] and kept_files(tmp_path) == []
        for action, words in (
            ("calibrate.undo", "not stored: 1 point "),
            ("calibrate.drop", "None is stored"),
            ("calibrate.undo", "not stored: 1 point "),
        ):
            await stage.act_on(action)
            assert words in stage.words, action


async def test_before_the_first_point_nothing_is_wrong_nothing_is_left_and_empty_plots_name_their_units(
    tmp_path: Path,
) -> None:
    async with on_page(CalibrateScene, tmp_path) as stage:
        await stage.show()
        await stage.act_on("calibrate.kind", "calibrate.new")
        assert "Young's modulus" in stage.words and "!" not in stage.words
        await stage.enter("")
        assert "None is stored" in stage.words and stage.field() == FieldKind.NONE
        await stage.act_on("calibrate.keep")
        assert stage.codes == ["screen.calibrate_nothing"] and kept_files(tmp_path) == []
        await stage.act_on("calibrate.kind", "calibrate.kind", "calibrate.kind", "calibrate.view")
        for units in ("N over N m", "um: measured over fitted", "No plot"):
            assert units in stage.text
            await stage.act("calibrate.kind")


async def test_a_long_list_is_walked_by_the_page_and_from_end_to_end(tmp_path: Path) -> None:
    for day in range(10, 30):
        keep_wrench(tmp_path, date=f"2025-11-{day}T08:00:00.000Z")
    async with on_page(CalibrateScene, tmp_path, size=(80, 18)) as stage:
        await stage.show()
        assert "▶ 2025-11-29" in stage.words
        for action, day in (("last", 10), ("page_up", 15), ("page_up", 20), ("page_down", 15), ("first", 29)):
            await stage.act_on(f"calibrate.{action}")
            assert f"▶ 2025-11-{day}" in stage.words, action


async def test_a_table_is_imported_byte_for_byte_and_a_broken_one_refused_with_its_line(tmp_path: Path) -> None:
    good, bad = tmp_path / "good.csv", tmp_path / "bad.csv"
    good.write_text(f"# remark: load cell 3\n{WRENCH}", encoding="utf-8")
    bad.write_text(WRENCH.replace("3741", "x"), encoding="utf-8")
    async with on_page(CalibrateScene, tmp_path, size=(100, 24)) as stage:
        await stage.show()
        await stage.act_on("calibrate.import")
        assert stage.field() == FieldKind.TEXT
        await stage.enter(str(bad))
        assert stage.codes == ["calibration.not_number"] and stage.field() == FieldKind.TEXT
        await stage.enter(str(good))
        assert "not stored: 10 points" in stage.words
        await stage.act_on("calibrate.offset")
        assert "force at zero torque" in stage.words
        await stage.act_on("calibrate.keep")
        assert kept_files(tmp_path) == ["wrench-000001.json"]
    record = json.loads((tmp_path / "calibrations" / MACHINE / "wrench-000001.json").read_text())
    assert record["file"] == str(good) and record["found"]["intercept_ci"] > 0.0


async def test_deflections_ask_for_the_modulus_of_the_bar_and_offer_what_stays_the_same(tmp_path: Path) -> None:
    async with on_page(CalibrateScene, tmp_path) as stage:
        await stage.show()
        await stage.act_on("calibrate.kind", "calibrate.new")
        await stage.enter("206", "1314", "100", "0", "52", "60", "4,21")
        entry = stage.page._all.entry  # type: ignore[attr-defined]
        offered = []
        for value in ("", "", "30", "", "", "4.4"):
            offered.append((entry.asked.key, entry.value))
            await stage.enter(value or entry.value)
        assert offered == [
            ("chucking_force_n", "1314"),
            ("load_n", "100"),
            ("angle_deg", ""),
            ("diameter_mm", "52"),
            ("overhang_mm", "60"),
            ("deflection_um", ""),
        ]
        assert "not stored: 2 points" in stage.words


async def test_an_entry_ends_when_the_machine_moves_and_nothing_is_stored_then(tmp_path: Path) -> None:
    async with on_page(CalibrateScene, tmp_path) as stage:
        await stage.show()
        await stage.act_on("calibrate.import")
        stage.control.state = MOVING
        await stage.show()
        assert stage.field() == FieldKind.NONE, "Space is a stop again"
        for action in ("calibrate.new", "calibrate.import", "calibrate.keep"):
            stage.ui.key_answer = ()
            await stage.act_on(action)
            assert stage.codes == ["screen.calibrate_moving"]


def test_which_calibration_counts_is_what_the_next_start_does(tmp_path: Path) -> None:
    keep_wrench(tmp_path, date="2025-01-01T08:00:00.000Z")
    keep_wrench(tmp_path, date="2025-01-02T08:00:00.000Z")
    keep_wrench(tmp_path, date="2025-01-03T08:00:00.000Z", chuck="another")
    started = apply_calibrations(load_machine(MACHINE), tmp_path)
    keep_wrench(tmp_path, date="2025-01-04T08:00:00.000Z")
    (tmp_path / "calibrations" / MACHINE / "wrench-000005.json").write_text("{}", encoding="utf-8")

    def standings(machine: Any) -> list[str]:
        return [str(each.standing) for each in kept_list(tmp_path, machine, "wrench")]

    (tmp_path / "calibrations" / MACHINE / "wrench-000005.json").unlink()
    assert standings(started) == ["next_start", "other_chuck", "older", "older"]
    assert standings(apply_calibrations(load_machine(MACHINE), tmp_path)) == [
        "in_force",
        "other_chuck",
        "older",
        "older",
    ]
    # A profile that states the line as its own is right, whatever was measured.
    profile = tmp_path / "stated.toml"
    text = load_machine(MACHINE).text.replace('  "chuck.force_per_torque_n_per_n_m",\n', "")
    profile.write_text(text.replace('  "chuck.force_sd_percent",\n', ""), encoding="utf-8")
    stated = load_machine(str(profile))
    assert standings(stated)[0] == str(CalibrationStatus.PROFILE)


def test_the_points_are_shown_only_while_their_file_is_what_was_fitted(tmp_path: Path) -> None:
    records_stage.fill_calibrations(tmp_path)
    (row, _) = kept_list(tmp_path, lathe(), "wrench")

    def facts() -> ChuckFacts:
        return kept_facts(row)

    assert facts().measured is not None
    with (tmp_path / "calibrations" / MACHINE / TABLE).open("a", encoding="utf-8") as file:
        file.write("60;99999\n")
    assert facts().measured is None and facts().fit is not None


async def test_the_lobes_of_the_jobs_are_listed_and_say_how_one_is_taken(tmp_path: Path) -> None:
    records_stage.fill_calibrations(tmp_path)
    async with on_page(CalibrateScene, tmp_path) as stage:
        await stage.show()
        await stage.act_on("calibrate.kind", "calibrate.kind")
        assert "54.21 ± 0.62 um p-p" in stage.words and "for practice" in stage.words
        await stage.act_on("calibrate.new")
        assert stage.codes == ["screen.calibrate_lobe"]


def test_every_standing_has_its_words() -> None:
    for language in ("en", "ko"):
        text = load(language)
        for standing in CalibrationStatus:
            assert text(f"calibrate_page.why.{standing}") != f"calibrate_page.why.{standing}"
            if standing is not CalibrationStatus.OF_JOB:
                assert text(f"calibrate_page.{standing}") != f"calibrate_page.{standing}"


async def test_in_motion_nothing_is_fitted_before_scipy_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    records_stage.fill_calibrations(tmp_path)
    monkeypatch.setattr("console.tui.further.calibrate.STATISTICS", "no.such.module")
    async with on_page(CalibrateScene, tmp_path, state=MOVING, size=(100, 24)) as stage:
        await stage.show()
        assert "read at standstill" in stage.words and "377" not in stage.words
        stage.control.state = replace(MOVING, activity=Activity.READY)
        await stage.show()
        await stage.show()
        assert "377.57" in stage.words


async def test_in_inches_a_point_keeps_what_was_not_typed_again(tmp_path: Path) -> None:
    """52 mm are 2.0472… in: the digits of the entry round it, Enter on them does not."""
    try:
        async with on_page(CalibrateScene, tmp_path) as stage:
            stage.ui.text._measure_in(Units("inch"))
            await stage.show()
            await stage.act_on("calibrate.kind", "calibrate.new")
            await stage.enter("206", "1314", "200", "0", "2.047244094488189", "1.2", "100")
            began = []
            for typed in ("", "", "30", "", "", "200"):
                entry = stage.page._all.entry  # type: ignore[attr-defined]
                began.append(entry.value)
                await stage.enter(typed or entry.value)
            draft = stage.page._draft  # type: ignore[attr-defined]
            assert began == ["1314", "200", "", "2.0472", "1.2", ""]
            assert draft.rows[1][3:] == (draft.rows[0][3], draft.rows[0][4], 5.08)
    finally:
        load("en")._measure_in(METRIC)  # one catalogue for all tests of a process


def test_entered_points_are_read_back_whatever_their_decimals() -> None:
    rows = ((1.234, 5.678), (2.345, 7.891), (3.456, 9.012))
    measured = Draft(kind=CalibrationKind.WRENCH, rows=rows).measured_table()
    assert list(zip(*measured.columns.values(), strict=True)) == list(rows)
    assert measured.numbers_read == ""
