"""Flanks of jaw 1, the skim cut and the wrench on the page Align; the chuck at 80 x 24."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from console.session.configuration import Configuration, Setting, SettingOrigin
from console.session.cut.alignment import Alignment
from console.session.station.commands import (
    Command,
    Forget,
    NoteSkim,
    TakeFingerprint,
    TakeFlank,
    TakeJaw,
    TakeTouchOff,
)
from console.session.station.state import StationState
from console.text.catalogue import load
from console.tui.align.answers import clamp_answer, clamp_lines
from console.tui.align.entry_context import EntryContext, EntryKind
from console.tui.pages.align import AlignPage
from console.units import Units
from drivers.simulator.plant.workshop_view import WorkshopView
from tests.console.guide.test_fingerprint_offer import after_a_part
from tests.played_indicator import Instrument, instrument
from tests.tui.align_stage import NO_JAW, OFF, VALID, look, shown, state, words_of
from tests.tui.page_stage import PageScene, on_page, run_apart
from tests.tui.stage import JAW, LANGUAGES, experiment

__all__ = ["instrument"]

SIX = (352.0, 8.0, 352.1, 8.1, 351.9, 7.9)
TOUCHING = state(replace(NO_JAW, jaw=JAW), snapshot=look(carriage_mm=172.0))
SKIMMED = replace(TOUCHING, alignment=replace(TOUCHING.alignment, skim_counts=250_000.0))
UNCLAMPED = state(Alignment(settings=()), snapshot=look(OFF))


class AlignScene(PageScene):
    page_class = AlignPage

    async def type(self, text: str) -> None:
        self.page._entry.value = text  # type: ignore[attr-defined]
        await self.show()


def typed(
    now: StationState, *keys: str, language: str = "en", units: str = "mm"
) -> tuple[str, Sequence[Command], list[str]]:
    """Press keys of the page, type what is no key of it, and look."""

    async def run() -> tuple[str, Sequence[Command], list[str]]:
        async with on_page(AlignScene, Path("/nowhere"), work=experiment(), state=now, language=language) as stage:
            stage.ui.text._measure_in(Units(units))
            await stage.show()
            for key in keys:
                await (stage.act(key) if key.startswith("align.") else stage.type(key))
            await stage.show()
            return stage.text, stage.control.orders, stage.codes

    return run_apart(run)


def test_i_takes_a_flank_and_enter_their_mean_with_the_limit_of_the_part() -> None:
    assert shown(state(), "align.flank").orders == [TakeFlank()]
    all_six = state(replace(NO_JAW, flanks=SIX))
    page = shown(all_six, "align.take")
    (taken,) = page.orders
    assert isinstance(taken, TakeJaw) and taken.most_spread_deg == pytest.approx(1.39, abs=0.005)
    words = words_of(page.text)
    assert "1: 352.00 8.00 → 0.00°" in words and "3: 351.90 7.90 → 359.90°" in words
    assert "jaw 1 at 0.00°, spread 0.20°; the part allows 1.39°" in words
    assert page.next_step == "Enter takes jaw 1 by its flanks; b drops a reading."


def test_readings_that_do_not_suffice_are_not_taken_and_a_flank_in_its_step_alone() -> None:
    for alignment, key, code in (
        (replace(NO_JAW, flanks=SIX[:3]), "align.take", "alignment.flanks_incomplete"),
        (replace(NO_JAW, flanks=(*SIX[:4], 354.0, 10.0)), "align.take", "alignment.spread_too_large"),
        (replace(NO_JAW, flanks=SIX), "align.flank", "alignment.flanks_complete"),
        (VALID, "align.flank", "screen.no_flank_now"),
    ):
        page = shown(state(alignment), key)
        assert (page.orders, page.said) == ([], [code])


def test_the_stamp_tells_the_spread_and_the_micrometer() -> None:
    assert VALID.touch_off is not None
    stamps = replace(VALID, jaw=replace(JAW, spread_deg=0.04), touch_off=replace(VALID.touch_off, skimmed=True))
    text = shown(state(stamps, seen=None, simulated=False)).text
    assert "12.60 ± 0.04 °" in text
    assert "micrometer" in text


def test_m_notes_the_skim_cut_and_then_asks_for_its_diameter() -> None:
    assert shown(TOUCHING, "align.skim").orders == [NoteSkim()]
    # The tool was at 50 mm from its zero: with D 51.940 the tip is at 75.97 there, 30 um less than in the profile.
    text, orders, said = typed(SKIMMED, "align.skim", "51,94")
    assert (orders, said) == ([], [])
    assert "→ D 51.940 mm" in text
    assert "tool zero R 75.9700 mm" in text
    assert "-30.0 um from the machine profile" in text
    orders = typed(SKIMMED, "align.skim", "51,94", "align.take")[1]
    assert orders == [TakeTouchOff(radius_mm=25.97, skimmed=True)]


def test_a_measured_tip_is_compared_with_the_touch_off_there_was() -> None:
    again = state(replace(VALID, skim_counts=250_000.0), snapshot=look(carriage_mm=172.0))
    text = typed(again, "align.skim", "53.02")[0]
    # R 76.5 by the touch-off; 26.51 + 50 by the micrometer.
    assert "+10.0 um from the touch-off R 76.5000 mm" in " ".join(text.replace("│", " ").split())


def test_what_is_no_diameter_of_the_part_is_not_taken_and_beside_it_no_skim_cut_noted() -> None:
    for given, code in (
        ("", "screen.no_diameter"),
        ("12", "screen.number_out_of_range"),
        ("5.1.9", "value.ambiguous"),
    ):
        assert typed(SKIMMED, "align.skim", given, "align.take")[1:] == ([], [code])
    assert shown(state(replace(NO_JAW, jaw=JAW)), "align.skim").said == ["alignment.beside_part"]
    assert shown(state(), "align.skim").said == ["screen.no_skim_now"]


def test_the_wrench_becomes_force_and_back_with_the_window_of_the_part() -> None:
    chuck = experiment().machine.machine.chuck
    slope = chuck.force_per_torque_n_per_n_m
    assert slope is not None
    text = typed(UNCLAMPED, "align.force", "3,5")[0]
    assert f"→ 3.50 N m = {3.5 * slope:.0f} N" in text
    assert f"job   1314 N ({1314.0 / slope:.1f} N m)" in text
    back = typed(UNCLAMPED, "align.force", "align.force", "1314")[0]
    assert f"→ {1314.0 / slope:.2f} N m = 1314 N" in back
    assert "within the window of this part" in back
    assert "too little" in typed(UNCLAMPED, "align.force", "align.force", "100")[0]
    # It is a calculation: neither Enter nor f changes anything.
    assert typed(UNCLAMPED, "align.force", "3,5", "align.take")[1] == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_entry_fits_its_panel_at_80_columns(language: str) -> None:
    for now, keys in (
        (TOUCHING, ("align.goto", "100")),
        (TOUCHING, ("align.goto", "align.goto", "100")),
        (SKIMMED, ("align.skim", "51.94")),
        (UNCLAMPED, ("align.force", "3.5")),
        (UNCLAMPED, ("align.force", "align.force", "1314")),
    ):
        text = typed(now, *keys, language=language)[0]
        left = text.splitlines()[-2].split("││")[0]
        assert "w" not in left, text  # nothing is left out of the panel
        assert "align_page" not in text


def test_the_chuck_is_drawn_with_the_angle_of_the_spindle_on_a_real_lathe_once_jaw_1_is_found() -> None:
    """The spindle is at 12.6 degrees, jaw 1 was found at 2.6."""
    text = shown(state()).text
    assert "◂ mark" in text and "C 12.60°" in text and "jaw 1 +12.34°" in text
    other_way = shown(state(seen=WorkshopView(jaw_1_past_mark_deg=-170.0, tool_gap_mm=None))).text
    assert text != other_way and "jaw 1 -170.00°" in other_way
    assert "◂" not in shown(state(simulated=False, seen=None), size=(100, 30)).text
    found = state(replace(NO_JAW, jaw=replace(JAW, angle_deg=2.6)), simulated=False, seen=None)
    drawn = shown(found, size=(100, 30)).text
    assert "◂" in drawn and "by jaw 1 as found" in drawn


CLAMPED = state(replace(NO_JAW, readings=None))


def readings_keys(places: int, tight: float, full: float) -> list[str]:
    """Return the keys that type readings: the same at each place, but for 30 um up and down three times a turn."""
    keys = ["align.clamping", str(places), "align.take"]
    for base, lobe in ((tight, 0.0), (full, 30.0)):
        for place in range(places):
            keys += [f"{base - lobe * math.cos(2.0 * math.pi * 3 * place / places):.1f}", "align.take"]
    return keys


@pytest.mark.parametrize("language", LANGUAGES)
def test_n_asks_for_readings_in_both_states_and_enter_takes_them_for_this_part(language: str) -> None:
    text, orders, codes = typed(CLAMPED, *readings_keys(12, 4.0, -2.0), language=language)
    assert codes == []
    assert "3/rev 60.0 ±" in text
    _, orders, _ = typed(CLAMPED, *readings_keys(12, 4.0, -2.0), "align.take", language=language)
    (taken,) = [each for each in orders if isinstance(each, TakeFingerprint)]
    assert taken.readings is not None and taken.readings.from_jaw_1
    assert taken.readings.angle_deg[:3] == (0.0, 30.0, 60.0)
    assert taken.readings.finger_um == (4.0,) * 12
    assert taken.readings.full_um[:2] == (-32.0, -2.0)


def test_readings_of_a_dial_in_inches_are_typed_and_shown_in_millionths_of_an_inch() -> None:
    """300 uin are 7.62 um; twice 30 um a lobe are 2362 uin; such a dial has 0.0001 in, 2.54 um."""
    text, _, codes = typed(CLAMPED, "align.clamping", "12", "align.take", "300", units="inch")
    assert codes == [] and "uin" in text
    full = [f"{300.0 - 1181.1 * math.cos(2.0 * math.pi * 3 * place / 12):.0f}" for place in range(12)]
    keys = ["align.clamping", "12"] + [key for each in ["300"] * 12 + full for key in ("align.take", each)]
    text, _, _ = typed(CLAMPED, *keys[: 2 + 2 * 13], units="inch")
    assert "finger-tight +300 uin" in text
    text, _, _ = typed(CLAMPED, *keys, "align.take", units="inch")
    assert "3/rev 2362 ±" in text and "uin p-p" in text and "um" not in text
    _, orders, _ = typed(CLAMPED, *keys, "align.take", "align.take", units="inch")
    (taken,) = [each for each in orders if isinstance(each, TakeFingerprint)]
    assert taken.readings is not None and taken.readings.graduation_um == 2.54
    assert taken.readings.finger_um == pytest.approx((7.62,) * 12)


def read_by_line(line: str | None, *keys: str, units: str = "mm") -> tuple[str, str, list[str]]:
    """Press keys with an indicator on a line, wait for each reading; return the page, the entry and the codes."""

    async def run() -> tuple[str, str, list[str]]:
        async with on_page(AlignScene, Path("/nowhere"), work=experiment(), state=CLAMPED) as stage:
            stage.ui.text._measure_in(Units(units))
            given = {} if line is None else {"indicator": Setting(value=line, origin=SettingOrigin.OPTION)}
            stage.ui.configuration = Configuration(settings=given, files={})
            for key in keys:
                await (stage.act(key) if key.startswith("align.") else stage.type(key))
                while stage.page._ask._errand.running:  # type: ignore[attr-defined]
                    await stage.pilot.pause()
                await stage.show()
            entry = stage.page._entry.value  # type: ignore[attr-defined]
            return stage.text, entry, stage.codes

    return run_apart(run)


IN_THE_ENTRY = ("align.clamping", "8", "align.take")


@pytest.mark.parametrize(("units", "shown"), [("mm", "+42.10"), ("inch", "+1657.5")])
def test_i_reads_a_digital_indicator_into_the_field(instrument: Instrument, units: str, shown: str) -> None:
    """0.0421 mm are 42.1 um, or 1657.5 millionths of an inch; Enter takes them as if they were typed."""
    instrument.replies[b"?\r"] = b"+0.0421\r"
    line = f"{instrument.device}:opto-mm"
    text, entry, codes = read_by_line(line, *IN_THE_ENTRY, "align.flank", units=units)
    assert codes == [] and "i reads the indicator" in text
    assert float(entry) == pytest.approx(float(shown), abs=0.05)
    text, entry, codes = read_by_line(line, *IN_THE_ENTRY, "align.flank", "align.take", units=units)
    assert codes == [] and entry == "" and "place 2 of 8" in text


def test_what_is_no_reading_leaves_the_field_empty_and_says_why(instrument: Instrument) -> None:
    instrument.replies[b"?\r"] = b"ERR0\r"
    text, entry, codes = read_by_line(f"{instrument.device}:opto-mm", *IN_THE_ENTRY, "align.flank")
    assert (entry, codes) == ("", ["indicator.error"]) and "place 1 of 8" in text


def test_without_a_line_or_before_the_readings_i_reads_nothing() -> None:
    assert read_by_line(None, *IN_THE_ENTRY, "align.flank")[1:] == ("", ["screen.no_indicator_line"])
    assert read_by_line("/dev/null:opto-mm", "align.clamping", "align.flank")[2] == ["screen.no_flank_now"]
    assert read_by_line("/dev/null:opto-mm", *IN_THE_ENTRY, "align.flank")[1:] == ("", ["link.not_serial"])


def test_readings_of_an_indicator_with_a_coarse_last_digit_count_for_no_more(instrument: Instrument) -> None:
    instrument.replies[b"1\r"] = b"01A+00000.01\r"
    keys = [key for _ in range(16) for key in ("align.flank", "align.take")]

    async def run() -> Sequence[Command]:
        async with on_page(AlignScene, Path("/nowhere"), work=experiment(), state=CLAMPED) as stage:
            line = Setting(value=f"{instrument.device}:mux10-mm", origin=SettingOrigin.OPTION)
            stage.ui.configuration = Configuration(settings={"indicator": line}, files={})
            for key in (*IN_THE_ENTRY, *keys, "align.take"):
                await (stage.act(key) if key.startswith("align.") else stage.type(key))
                while stage.page._ask._errand.running:  # type: ignore[attr-defined]
                    await stage.pilot.pause()
                await stage.show()
            return stage.control.orders

    (taken,) = [each for each in run_apart(run) if isinstance(each, TakeFingerprint)]
    assert taken.readings is not None and taken.readings.graduation_um == 10.0
    assert taken.readings.finger_um == (10.0,) * 8


@pytest.mark.parametrize(("size", "language"), [((80, 24), "en"), ((80, 24), "ko"), ((160, 48), "en")])
def test_a_fingerprint_is_offered_with_its_time_and_gain_where_it_is_worth_it(
    size: tuple[int, int], language: str
) -> None:
    for now in (CLAMPED, state(replace(VALID, readings=None))):
        page = shown(now, work=after_a_part(), size=size, language=language)
        offered = re.search(r"n: .*?(\d)\s?(?:min|분).*?±(\d+\.\d) → ±(\d+\.\d) um", words_of(page.text))
        assert offered is not None, page.text
        assert offered[1] == "4" and float(offered[3]) < float(offered[2])
        assert " → ±" not in shown(now, size=size, language=language).text, "nothing is known yet"


@pytest.mark.parametrize(("jaws", "least", "both"), [(2, 6, 6), (3, 6, 7), (4, 8, 9), (6, 12, 13)])
def test_as_many_places_are_asked_for_as_the_chuck_needs(jaws: int, least: int, both: int) -> None:
    work = experiment()
    job, machine = replace(work.job, jaws=jaws), work.machine.machine
    few = EntryContext(asked=EntryKind.PLACES, typed=str(least - 1), state=CLAMPED, job=job, machine=machine)
    assert [each.code for each in clamp_answer(few).problems] == ["screen.number_out_of_range"]
    assert clamp_answer(replace(few, typed=str(least))).problems == ()
    said = "".join(words for row in clamp_lines(load("en"), few, 200)[1:] for words, _ in row)
    assert f"{least} to 48, evenly round the part" in said and f"{both} or more show the angle" in said


def test_a_reading_is_dropped_and_what_was_typed_is_kept_while_the_entry_is_closed() -> None:
    keys = ["align.clamping", "8", "align.take", "5", "align.take", "6", "align.take"]
    text, orders, _ = typed(CLAMPED, *keys, "align.back", "align.clamping", "align.clamping")
    assert "place 2 of 8, 45° past jaw 1" in text and "finger-tight" in text
    assert not [each for each in orders if isinstance(each, (TakeFingerprint, Forget))]


@pytest.mark.parametrize(
    ("keys", "code"),
    [
        (["align.take"], "screen.no_places"),
        (["5", "align.take"], "screen.number_out_of_range"),
        (["7.5", "align.take"], "screen.number_out_of_range"),
        (["8", "align.take", "align.take"], "screen.no_reading"),
        (["8", "align.take", "9999", "align.take"], "screen.number_out_of_range"),
    ],
)
def test_what_is_no_reading_is_not_taken(keys: list[str], code: str) -> None:
    _, _, codes = typed(CLAMPED, "align.clamping", *keys)
    assert codes == [code]


def test_readings_are_of_a_clamped_blank() -> None:
    _, orders, codes = typed(UNCLAMPED, "align.clamping")
    assert codes == ["screen.no_readings_now"] and orders == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_readings_far_from_what_is_expected_are_said_before_they_are_taken(language: str) -> None:
    """Half of the lobe of 60 um that was expected, give or take 12: more than 4 standard deviations."""
    keys = readings_keys(12, 4.0, -2.0)
    half = [key if key[0] not in "-0123456789." or key == "12" else f"{0.55 * float(key):.1f}" for key in keys]
    word = {"en": "standard deviations off", "ko": "표준편차"}[language]
    far, near = (typed(CLAMPED, *each, language=language)[0] for each in (half, keys))
    assert word in " ".join(far.split()) and word not in near
