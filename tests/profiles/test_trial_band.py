"""A trial band: what a dial on it shows of tool and process, and the part that is cut by it."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import replace
from random import Random

import pytest

from drivers.cutting.planning import nominal_command
from drivers.cutting.strategy import Strategy
from profiles.compensations.path import AlongCut, CutPath, target_path
from profiles.compensations.trial_band import (
    LEFT_MM,
    BandReadings,
    band_job,
    band_path,
    correct_by_band,
    find_on_band,
    refuse_uncleaned,
    shown_path,
    wanted_at,
    without_play,
)
from profiles.fingerprint.lobe_filter import MeasuredCoefficient
from profiles.fingerprint.readings import ClampReadings
from profiles.fingerprint.this_clamping import known_lobe
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine

JOB = load_job("lee-2001-experiment-1").job
MACHINE = load_machine("lee-2001-lathe").machine
LOBE = 24.0 * cmath.exp(-0.4j)
ONCE_ROUND = [22.5 * place for place in range(16)]
ROUND_AND_BACK = (*ONCE_ROUND, *reversed(ONCE_ROUND))


def surface(orders: dict[int, complex]) -> Callable[[float], float]:
    return lambda deg: sum((c * cmath.exp(1j * n * math.radians(deg))).real for n, c in orders.items())


def dial(height: Callable[[float], float], play_um: float, noise_um: float, chance: Random) -> BandReadings:
    """Return readings by a pointer that a slot as wide as the play drags along, a tenth of a degree at a time."""
    slot, shown, at = height(0.0), [], 0.0
    for deg in ROUND_AND_BACK:
        steps = max(1, round(abs(deg - at) * 10))
        for step in range(1, steps + 1):
            pushed = height(at + (deg - at) * step / steps)
            if pushed > slot + play_um / 2:
                slot = pushed - play_um / 2
            elif pushed < slot - play_um / 2:
                slot = pushed + play_um / 2
        at = deg
        shown.append(slot + chance.gauss(0.0, noise_um))
    return BandReadings(angle_deg=ROUND_AND_BACK, shown_um=tuple(shown))


@pytest.mark.parametrize("play_um", [0.0, 3.0])
def test_a_dial_with_play_shows_the_motion_of_the_tool(play_um: float) -> None:
    off = []
    for seed in range(40):
        wave = {1: 2.0 + 0j, 2: 6.0 * cmath.exp(1j * seed), 3: 24.0 * cmath.exp(2j * seed)}
        found = shown_path(dial(surface(wave), play_um, 0.5, Random(seed)), 3)
        off += [abs(found.coefficients_um[n] + wave[n]) for n in (2, 3)]
        assert 1 not in found.coefficients_um
    # Two components with the noise of 32 readings each; without the play the lobe would be 0.6 um too low.
    assert sum(off) / len(off) < 0.35


def test_a_fingerprint_without_play_has_its_lobe() -> None:
    def heights(play_um: float, lobe_um: float) -> tuple[float, ...]:
        wave = {1: 20.0 + 0j, 3: lobe_um + 0j}
        return dial(surface(wave), play_um, 0.0, Random(0)).shown_um

    dry, real = ([heights(play, lobe) for lobe in (1.4, 27.0)] for play in (0.0, 3.0))
    readings = [
        ClampReadings(angle_deg=ROUND_AND_BACK, finger_um=each[0], full_um=each[1]) for each in (dry, real)
    ]
    freed = without_play(readings[1], 3)
    off = [
        max(abs(a - b) for a, b in zip(each.full_um, readings[0].full_um, strict=True))
        for each in (readings[1], freed)
    ]
    assert off[0] > 1.4 and off[1] < 0.4
    one_way = replace(readings[1], **{name: getattr(readings[1], name)[:16] for name in READ})
    assert without_play(one_way, 3) == one_way


READ = ("angle_deg", "finger_um", "full_um")


@pytest.mark.parametrize("stylus_deg", [-1.3, 0.0, 1.0])
@pytest.mark.parametrize("gain", [0.82, 1.0])
def test_the_part_is_round_where_the_band_was_read(gain: float, stylus_deg: float) -> None:
    """The lathe loses a fraction of each motion, and a blank copies itself; a stylus off its mark reads both."""
    lobe, copied, turn = 25.5 * cmath.exp(0.05j), 1.5 * cmath.exp(1j), math.radians(stylus_deg)
    known = known_lobe(25.0 + 0j, JOB, MACHINE, 0.07, 3.0).predict_clamping()
    felt = lobe * known.scale.at_rest * cmath.exp(3j * turn)
    before = known.update_by_fingerprint(MeasuredCoefficient(value=felt, sd_um=0.2))
    target = {2: 8.0 * cmath.exp(2j * turn), 3: before.this_um, 6: 0j}  # the oval by the same stylus
    cut = {n: gain * c + (copied if n == 2 else 0j) for n, c in target.items()}
    readings = dial(surface({n: -c * cmath.exp(1j * n * turn) for n, c in cut.items()}), 2.0, 0.0, Random(1))
    found = find_on_band(shown_path(readings, 3), target, {}, 3, 0.0)
    _, made = correct_by_band(before, found, (2,), 3)
    assert made.arrives == pytest.approx(gain, abs=0.03)
    after = {n: c + made.added_um.get(n, 0j) for n, c in target.items()} | {3: target[3] * made.of_this}
    left = {
        2: 8.0 - gain * after[2] - copied,
        3: lobe - gain * after[3],
    }
    uncorrected = {2: 8.0 - cut[2], 3: lobe - cut[3]}
    assert abs(left[2]) < 0.5 and abs(left[3]) < 1.0
    if gain < 1.0:
        assert abs(uncorrected[3]) > 4.0


def path() -> CutPath:
    return CutPath(target=target_path(JOB), command=nominal_command(JOB, MACHINE, Strategy.CAM))


def test_the_band_has_the_path_of_its_place_at_less_depth() -> None:
    along = AlongCut(half_length_mm=4.0, orders=((3, (0.2, 0.03)),))
    band = band_path(path().add_push(20.0), along, JOB, 2.0)
    s = -3.4 / 4.0
    factor = 1.0 + 0.2 * s + 0.03 * s * s
    assert wanted_at(band.target, 0.0)[3] == pytest.approx(factor * target_path(JOB).harmonics[0].coefficient)
    assert band.target.mean_um == pytest.approx(100.0 - 20.0)
    assert band.command.push_um == pytest.approx(20.0 * 0.8)  # it cuts four fifths of the depth
    short = band_job(JOB, factor)
    assert short.cut_length_mm == 1.2 and short.depth_of_cut_mm == pytest.approx(0.08)


@pytest.mark.parametrize(
    ("arrived", "code"), [(0.5, "band.not_like"), (1.3, "band.not_like"), (-0.9, "band.not_like")]
)
def test_a_band_that_is_not_of_tool_and_process_is_refused(arrived: float, code: str) -> None:
    shown = shown_path(dial(surface({3: -arrived * LOBE}), 0.0, 0.0, Random(0)), 3)
    with pytest.raises(ProfileError) as refused:
        find_on_band(shown, {3: LOBE}, {}, 3, 0.0)
    assert refused.value.problems[0].code == code


def test_a_change_that_the_rest_of_the_depth_does_not_clean_is_refused() -> None:
    before, most_um = path(), 1000.0 * LEFT_MM
    after = replace(before, target=before.target.plus({2: most_um - 1.0 + 0j}))
    refuse_uncleaned(before, after)
    with pytest.raises(ProfileError, match=r"band\.uncleaned"):
        refuse_uncleaned(before, replace(before, target=after.target.plus({4: 1.5j})))


@pytest.mark.parametrize(
    ("change", "code"), [({"cut_length_mm": 3.5}, "band.short"), ({"depth_of_cut_mm": 0.04}, "band.shallow")]
)
def test_a_cut_without_room_for_a_band_is_refused(change: dict[str, float], code: str) -> None:
    with pytest.raises(ProfileError) as refused:
        band_job(replace(JOB, **change), 1.0)  # type: ignore[arg-type]
    assert refused.value.problems[0].code == code


def test_few_places_are_refused() -> None:
    places = tuple(45.0 * place for place in range(8))
    with pytest.raises(ProfileError, match=r"band\.few_places"):
        shown_path(BandReadings(angle_deg=places, shown_um=(0.0,) * 8), 3)
