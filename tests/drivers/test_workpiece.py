"""The part that the tool leaves: clamped round, released lobed, and exact between the servo samples."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.simulator.plant.workpiece import Blank, Workpiece
from profiles.roundness import evaluate

CYCLE_S = 3_713_707 / 8_388_608_000
RADIUS, FINISHED = 26.0, 25.9


def part(
    lobe: float = 0.0, jaws: int = 3, jaw_1: float = 0.0, sections: tuple[float, ...] = (100.0,)
) -> Workpiece:
    return Workpiece(Blank(radius_mm=RADIUS, lobe_um_pp=lobe, jaws=jaws, jaw_1_deg=jaw_1), sections, land_mm=0.4)


def pass_over(
    workpiece: Workpiece, radius_um: np.ndarray, turns: np.ndarray, z_mm: np.ndarray, block: int = 11
) -> None:
    """Hand the samples over in blocks, as the card does; `radius_um` is outward from the finished radius."""
    radius_mm = FINISHED + radius_um / 1000
    for start in range(0, len(turns), block):
        part_of = slice(start, start + block)
        workpiece.cut(radius_mm[part_of].tolist(), turns[part_of].tolist(), z_mm[part_of].tolist())


def deviation(workpiece: Workpiece, section: int = 0) -> tuple[np.ndarray, np.ndarray]:
    return workpiece.released_um(section, FINISHED)


def turning(seconds: float, rpm: float, start_turns: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Sample times and spindle turns."""
    time_s = np.arange(round(seconds / CYCLE_S)) * CYCLE_S
    return time_s, start_turns + time_s * rpm / 60


@pytest.mark.parametrize("start_turns", [0.0, 0.123, -3.7])
def test_between_the_samples_of_a_150_hz_motion_the_surface_is_exact(start_turns: float) -> None:
    """3000 rpm, three lobes of 27.5 um, 45 samples a turn, over more than one chunk of samples."""
    workpiece = part()
    _, turns = turning(5.0, 3000, start_turns)
    radius = -27.5 * np.cos(2 * np.pi * 3 * turns)
    pass_over(workpiece, radius, turns, np.full_like(turns, 100.0))
    angle, found = deviation(workpiece)
    assert np.abs(found + 27.5 * np.cos(np.radians(3 * angle))).max() < 0.01


def test_the_blocks_in_which_the_samples_come_do_not_matter() -> None:
    found = []
    for block in (1, 11, 977, 5000):
        workpiece = part()
        _, turns = turning(3.0, 1000)
        pass_over(workpiece, 5 * np.sin(2 * np.pi * 3 * turns + 1), turns, np.full_like(turns, 100.0), block)
        found.append(deviation(workpiece)[1])
    for other in found[1:]:
        assert np.abs(other - found[0]).max() < 1e-3


def test_a_single_slow_turn_leaves_no_place_uncut() -> None:
    """30 rpm: one turn takes more samples than are worked in at a time."""
    workpiece = part()
    _, turns = turning(2.1, 30)
    pass_over(workpiece, np.zeros_like(turns), turns, np.full_like(turns, 100.0))
    assert np.abs(deviation(workpiece)[1]).max() < 1e-6


def test_a_lobe_that_grows_is_larger_towards_the_jaws() -> None:
    """5 % a mm: 0.9, 1 and 1.1 of 27.5 um at 98, 100 and 102 mm, all of it high at jaw 1."""
    blank = Blank(radius_mm=RADIUS, lobe_um_pp=55, jaws=3, jaw_1_deg=20, growth_per_mm=0.05, middle_mm=100.0)
    workpiece = Workpiece(blank, (98.0, 100.0, 102.0), land_mm=0.4)
    for section, share in enumerate((0.9, 1.0, 1.1)):
        angle, found = deviation(workpiece, section)
        assert np.abs(found - 100 - share * 27.5 * np.cos(np.radians(3 * (angle - 20)))).max() < 1e-9


def test_an_uncut_part_springs_back_high_at_the_jaws_from_its_blank() -> None:
    angle, found = deviation(part(lobe=55, jaw_1=20))
    target = 100 + 27.5 * np.cos(np.radians(3 * (angle - 20)))
    assert np.abs(found - target).max() < 1e-9


@pytest.mark.parametrize(("jaws", "lobe", "jaw_1", "rpm"), [(3, 55, 0, 1000), (4, 21, 33, 640), (6, 8, -70, 2345)])
def test_a_round_cut_leaves_the_lobe_of_the_clamping(jaws: int, lobe: float, jaw_1: float, rpm: float) -> None:
    workpiece = part(lobe, jaws, jaw_1)
    _, turns = turning(1.0, rpm)
    pass_over(workpiece, np.zeros_like(turns), turns, np.full_like(turns, 100.0))
    angle, found = deviation(workpiece)
    result = evaluate(angle, found, None)
    assert result.ront_um == pytest.approx(lobe, abs=0.01)
    assert result.amplitude_um(jaws) == pytest.approx(lobe / 2, abs=0.001)
    crest = next(h.phase_deg for h in result.harmonics if h.n == jaws)
    assert np.cos(np.radians(jaws * (crest - jaw_1))) == pytest.approx(1)


def test_a_tool_that_moves_in_where_the_part_will_stand_high_leaves_it_round() -> None:
    workpiece = part(lobe=55)
    _, turns = turning(1.0, 1000)
    pass_over(workpiece, -27.5 * np.cos(2 * np.pi * 3 * turns), turns, np.full_like(turns, 100.0))
    assert np.ptp(deviation(workpiece)[1]) < 0.01


def test_a_tool_of_the_wrong_sign_doubles_the_error() -> None:
    workpiece = part(lobe=55)
    _, turns = turning(1.0, 1000)
    pass_over(workpiece, 27.5 * np.cos(2 * np.pi * 3 * turns), turns, np.full_like(turns, 100.0))
    assert np.ptp(deviation(workpiece)[1]) == pytest.approx(110, abs=0.01)


def test_a_path_at_a_constant_offset_changes_the_size_and_not_the_form() -> None:
    sizes, forms = [], []
    for offset in (0.0, -35.0):
        workpiece = part(lobe=33)
        _, turns = turning(1.0, 1000)
        pass_over(workpiece, np.full_like(turns, offset), turns, np.full_like(turns, 100.0))
        found = deviation(workpiece)[1]
        sizes.append(found.mean())
        forms.append(found - found.mean())
    assert sizes[1] - sizes[0] == pytest.approx(-35, abs=1e-6)
    assert np.abs(forms[1] - forms[0]).max() < 1e-6


def test_a_tool_outside_the_blank_cuts_nothing() -> None:
    workpiece = part()
    _, turns = turning(0.5, 1000)
    pass_over(workpiece, np.full_like(turns, 150.0), turns, np.full_like(turns, 100.0))
    assert np.abs(deviation(workpiece)[1] - 100).max() < 1e-9


def test_the_surface_is_the_least_radius_that_the_tool_has_been_at() -> None:
    workpiece = part()
    _, turns = turning(0.5, 1000)
    for radius in (20.0, 0.0, 50.0):
        # The tool changes its depth beside the part.
        z_mm = np.where((turns < 0.5) | (turns > turns[-1] - 0.5), 110.0, 100.0)
        pass_over(workpiece, np.full_like(turns, radius), turns, z_mm)
    assert np.abs(deviation(workpiece)[1]).max() < 1e-6


def test_only_the_land_of_the_tool_cuts_a_section() -> None:
    """The tool feeds from 99 to 99.9 mm; with 0.4 mm of land it reaches sections up to 100.1 mm."""
    workpiece = part(sections=(99.5, 100.05, 100.2))
    _, turns = turning(2.0, 1000)
    pass_over(workpiece, np.zeros_like(turns), turns, np.linspace(99.0, 99.9, len(turns)))
    assert np.abs(deviation(workpiece, 0)[1]).max() < 1e-6
    assert np.abs(deviation(workpiece, 1)[1]).max() < 1e-6
    assert deviation(workpiece, 2)[1].min() == pytest.approx(100)


def test_a_tool_that_leaves_a_section_and_comes_back_does_not_cut_it_in_between() -> None:
    workpiece = part()
    time_s, turns = turning(1.0, 1000)
    z_mm = np.where((time_s > 0.3) & (time_s < 0.7), 110.0, 100.0)
    radius = np.where((time_s > 0.4) & (time_s < 0.6), -80.0, 0.0)
    pass_over(workpiece, radius, turns, z_mm)
    assert np.abs(deviation(workpiece)[1]).max() < 1e-6


@pytest.mark.parametrize("feed", [0.4, 0.3999, 0.05])
@pytest.mark.parametrize("rpm", [1000, 2000, 2857])
def test_a_feed_of_up_to_the_land_leaves_no_place_uncut(feed: float, rpm: float) -> None:
    """The land is 0.4 mm: at that feed each place meets it in one turn only, in parts of servo intervals too."""
    workpiece = part(lobe=55)
    _, turns = turning(1.2 * 60 / rpm * (1 + 0.4 / feed), rpm, start_turns=0.377)
    middle = turns.mean()
    path = -27.5 * np.cos(2 * np.pi * 3 * turns)
    pass_over(workpiece, path, turns, 100.0 + feed * (turns - middle))
    assert np.ptp(deviation(workpiece)[1]) < 0.01


def test_only_the_part_of_an_interval_inside_the_land_cuts() -> None:
    """One turn takes 100 samples, fed 4 mm: the land of 0.4 mm covers a tenth of it, 36 deg."""
    workpiece = part()
    turns = np.arange(-50, 51) * 0.01 + 0.505
    pass_over(workpiece, np.zeros_like(turns), turns, 100.0 + 4.0 * (turns - 0.5))
    angle, found = deviation(workpiece)
    cut = np.abs(found) < 1e-6
    assert np.abs(found[~cut] - 100).max() < 1e-9
    assert (angle[cut].min(), angle[cut].max()) == (pytest.approx(162.0), pytest.approx(198.0))
    assert cut.sum() == 361


def test_a_land_that_goes_over_a_section_within_one_interval_cuts_it_there() -> None:
    workpiece = part()
    turns = np.arange(20) * 0.01
    z_mm = 99.0 + 2.0 * np.maximum(np.arange(20) - 9, 0).clip(max=1)
    pass_over(workpiece, np.zeros_like(turns), turns, z_mm)
    angle, found = deviation(workpiece)
    # Between samples 9 and 10, 32.4 to 36 deg: the land is over it from 0.4 to 0.6 of the way, 33.84 to 34.56.
    cut = angle[np.abs(found) < 1e-6]
    assert (cut.min(), cut.max()) == (pytest.approx(33.9), pytest.approx(34.5))


def test_a_spindle_that_stands_or_turns_back_is_not_cut() -> None:
    workpiece = part()
    _, turns = turning(0.5, 1000)
    pass_over(workpiece, np.full_like(turns, -50.0), np.full_like(turns, 0.25), np.full_like(turns, 100.0))
    pass_over(workpiece, np.full_like(turns, -50.0), 0.25 - turns, np.full_like(turns, 100.0))
    assert np.abs(deviation(workpiece)[1] - 100).max() < 1e-9
