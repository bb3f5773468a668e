"""Which fault parts in a row show: surfaces made point by point here, and what is said of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.arrays import Floats, floats
from profiles.compensations.hypotheses import (
    SURE_RATIO,
    FaultDiagnosis,
    KnownLathe,
    LatheFault,
    PartEvidence,
    diagnose,
)

TURN = floats(np.arange(3600) * np.pi / 1800.0)
LOBE_UM, JAW_1_DEG = 27.5, 40.0
LOBE = floats(LOBE_UM * np.cos(3.0 * (TURN - np.radians(JAW_1_DEG))))
LATHE = KnownLathe(
    lobes=3,
    lobe_um=complex(LOBE_UM * np.exp(-3j * np.radians(JAW_1_DEG))),
    jaw_1_deg=JAW_1_DEG,
    yields_um_per_n={3: 1.0 - 1.2j, 9: -0.3 + 0.1j, 15: -0.1 + 0.01j},
)


def part(surface_um: Floats, place: int = 0, *, tool: complex = 0j, seed: int = 0) -> PartEvidence:
    """A part with this surface, which a gauge with 0.1 um of noise has seen; 20 um large, with a taper of 5 um."""
    noise = np.random.default_rng([seed, place]).normal(scale=0.1, size=TURN.size)
    seen = np.fft.rfft(surface_um + noise) / (TURN.size / 2)
    left = {n: complex(seen[n]) for n in range(1, 16)}
    size_um, path_um = 20.0 + 0.3 * place, complex(np.fft.rfft(LOBE)[3] / (TURN.size / 2))
    how: dict[str, Any] = {"tool_um": tool, "size_um": size_um, "taper_um": 5.0}
    ront_um = float(np.ptp(surface_um + noise))
    return PartEvidence(left_um=left, path_um=path_um, ront_um=ront_um, place=place, **how)


def said(make: Callable[[int], Floats], parts: int = 3) -> FaultDiagnosis:
    return diagnose([part(make(place), place) for place in range(parts)], LATHE)


def turned(deg: float) -> Floats:
    return floats(LOBE_UM * np.cos(3.0 * (TURN - np.radians(JAW_1_DEG + deg)))) - LOBE


def played(play_um: float) -> Floats:
    """What a tip leaves that rests at each reversal until its scale has crossed the play, then is dragged."""
    at_rad = np.mod(3.0 * (TURN - np.radians(JAW_1_DEG)), 2.0 * np.pi)
    rests_rad = np.arccos(1.0 - play_um / LOBE_UM)
    out = LOBE_UM - 0.5 * play_um
    going_back = np.where(at_rad < rests_rad, out, LOBE_UM * np.cos(at_rad) + 0.5 * play_um)
    again = np.where(at_rad - np.pi < rests_rad, -out, LOBE_UM * np.cos(at_rad) - 0.5 * play_um)
    return LOBE - floats(np.where(at_rad < np.pi, going_back, again))


def oval(um: float, deg: float) -> Floats:
    return floats(um * np.cos(2.0 * (TURN - np.radians(deg))))


CLAMPED = (0.16, -0.12, 0.05)


@pytest.mark.parametrize(
    ("fault", "make"),
    [
        (LatheFault.ANGLE, lambda _: turned(-7.0)),
        (LatheFault.DRIFT, lambda place: turned(2.5 * place)),
        (LatheFault.CLAMPING, lambda place: CLAMPED[place] * LOBE),
        (LatheFault.FORCE, lambda _: 0.2 * LOBE),
        (LatheFault.BACKLASH, lambda _: played(9.0)),
        (LatheFault.BLANK, lambda place: oval(6.0, 70.0 * place)),
    ],
)
def test_a_fault_that_parts_show_is_stated(fault: LatheFault, make: Callable[[int], Floats]) -> None:
    found = said(make)
    assert (found.best.fault, found.sure) == (fault, True)
    left_um_pp = 2.0 * float(np.abs(np.fft.rfft(make(2))).max()) / (TURN.size / 2)
    assert 0.4 * left_um_pp < found.best.um_pp < left_um_pp + 0.1


def test_an_oval_that_is_the_same_on_each_part_is_of_the_gauge_or_the_spindle_and_never_sure() -> None:
    found = said(lambda _: oval(5.0, 17.0))
    assert {found.best.fault, found.next.fault} == {LatheFault.GAUGE, LatheFault.SPINDLE}
    assert found.ratio == pytest.approx(1.0) and not found.sure


def test_sound_parts_have_no_fault_that_is_sure() -> None:
    for seed in range(20):
        chance = np.random.default_rng(seed)
        force, deg, of_each = chance.normal(scale=[0.03, 0.7]), chance.normal(scale=0.7), chance.normal(size=3)
        parts = [part((force[0] + 0.012 * k) * LOBE + turned(deg), at, seed=seed) for at, k in enumerate(of_each)]
        found = diagnose(parts, LATHE)
        assert found.best.fault is LatheFault.USUAL or found.ratio < SURE_RATIO, seed


def test_what_the_scale_has_seen_is_the_tool_and_no_more_of_it_than_is_left() -> None:
    """A tool that was 12 um off, on a part that has 4 um of its lobe left."""
    off = 0.3 * np.exp(-1j) * LATHE.lobe_um

    def of(keep: float) -> Sequence[PartEvidence]:
        surface = floats(-keep * np.real(off * np.exp(3j * TURN)))
        return [part(surface, place, tool=complex(off)) for place in range(3)]

    found = diagnose(of(1.0), LATHE)
    assert found.best.fault is LatheFault.TOOL
    hidden = next(each for each in diagnose(of(0.25), LATHE).ranked if each.fault is LatheFault.TOOL)
    assert hidden.um_pp <= 2.0 * 0.25 * abs(off) + 0.5


def test_a_hold_is_named_only_where_one_is_recorded() -> None:
    parts = [replace(part(0.0 * LOBE, place), taper_um=5.0 + 8.0 * (place == 2)) for place in range(3)]
    assert all(each.fault is not LatheFault.HOLD for each in diagnose(parts, LATHE).ranked)
    found = diagnose([*parts[:2], replace(parts[2], held=True)], LATHE)
    assert found.best.fault is LatheFault.HOLD


def test_a_machine_that_warms_up_makes_parts_smaller_one_by_one() -> None:
    parts = [replace(part(0.0 * LOBE, at), size_um=20.0 - 40.0 * (1.0 - np.exp(-at / 5.0))) for at in range(3)]
    assert diagnose(parts, LATHE).best.fault is LatheFault.THERMAL


def alone(surface_um: Floats) -> FaultDiagnosis:
    """What is said of one part."""
    return diagnose([replace(part(surface_um), size_um=None, taper_um=None)], LATHE)


def scaled(height: float) -> Floats:
    return floats((height - 1.0) * LOBE)


@given(off_deg=st.floats(4.0, 60.0), way=st.sampled_from([-1.0, 1.0]))
def test_a_jaw_that_is_elsewhere_is_named_with_its_angle(off_deg: float, way: float) -> None:
    found = alone(turned(way * off_deg))
    assert found.best.fault is LatheFault.ANGLE
    assert (found.best.amount - way * off_deg + 60.0) % 120.0 - 60.0 == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("percent", [-25.0, -20.0, 20.0, 25.0])
def test_another_chucking_force_is_named_with_its_difference(percent: float) -> None:
    found = alone(scaled(1.0 + percent / 100.0))
    assert LatheFault.FORCE in {each.fault for each in found.ranked[:2]}, "of one part as likely as its clamping"
    force = next(each for each in found.ranked if each.fault is LatheFault.FORCE)
    assert force.amount == pytest.approx(percent, abs=0.5)


def test_a_tool_that_moves_the_wrong_way_is_named_and_never_more_than_is_left() -> None:
    found = alone(2.0 * LOBE)
    assert (found.best.fault, found.sure) == (LatheFault.SIGN, True)
    assert found.best.um_pp == pytest.approx(4.0 * LOBE_UM, rel=0.01)
    plain = [replace(part(LOBE), path_um=0j)]
    assert all(each.fault is not LatheFault.SIGN for each in diagnose(plain, LATHE).ranked), "without a path"


@pytest.mark.parametrize("arrives", [0.3, 0.5, 0.7])
def test_a_path_that_arrives_in_part_is_named_with_the_part(arrives: float) -> None:
    """Its scale has seen it, or nothing has been polled."""
    lost_um = -(1.0 - arrives) * LATHE.lobe_um
    for tool_um in (lost_um, None):
        found = diagnose([replace(part((1.0 - arrives) * LOBE), tool_um=tool_um)], LATHE)
        tool = next(each for each in found.ranked if each.fault is LatheFault.TOOL)
        assert tool.amount == pytest.approx(100.0 * arrives, abs=1.0)
        assert tool_um is None or found.best.fault is LatheFault.TOOL


@pytest.mark.parametrize("jaw", [1, 2, 3])
def test_a_jaw_that_presses_harder_is_named_with_its_number(jaw: int) -> None:
    """A ring under one more radial force: harmonics 1 / (n^2 - 1)^2, with a maximum at that jaw once released."""
    at = TURN - np.radians(JAW_1_DEG + (jaw - 1) * 120.0)
    harder_um = floats(sum(6.0 * (9.0 / (n**2 - 1) ** 2) * np.cos(n * at) for n in range(2, 12)))
    found = said(lambda _: harder_um)
    assert (found.best.fault, found.best.amount) == (LatheFault.JAW, jaw)


def test_what_is_not_of_the_chuck_and_noise_are_called_so() -> None:
    found = alone(floats(4.0 * np.cos(5.0 * TURN) + 3.0 * np.cos(6.0 * TURN) + 0.3 * np.cos(7.0 * TURN)))
    assert found.apart_um == {5: pytest.approx(8.0, abs=0.1)} and found.noise_um is None
    rough = floats(np.random.default_rng(3).normal(scale=2.0, size=TURN.size))
    found = alone(rough)
    assert found.apart_um == {} and found.noise_um == pytest.approx(float(np.ptp(rough)), abs=1.0)
