"""Why a part is not round: each fault of the set-up, made by hand point by point, is named with its size."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.arrays import Floats, floats
from profiles.compensations.causes import Cause, CauseKind, causes
from profiles.compensations.next_version import AppliedPath
from profiles.compensations.part_harmonics import part_harmonics
from profiles.compensations.path import CutPath, target_path
from profiles.job import Job
from profiles.store import load_job
from profiles.traces import Trace

ANGLE_DEG = np.arange(3600) / 10.0
FILTER_UPR = 50.0


def filed(jaws: int = 3) -> Job:
    """A lobe of 55 um p-p, its maximum 10 deg past jaw 1, which is at 40 deg of spindle."""
    job = load_job("lee-2001-experiment-1").job
    return replace(job, jaws=jaws, lobe_error_um_pp=55.0, lobe_phase_deg=50.0, lobe_past_jaw_deg=10.0, assumed=())


def lobe_um(job: Job, *, larger: float = 1.0, further_deg: float = 0.0) -> Floats:
    phase_deg = job.lobe_phase_deg + further_deg
    return floats(larger * 0.5 * job.lobe_error_um_pp * np.cos(job.jaws * np.radians(ANGLE_DEG - phase_deg)))


def said(
    left_um: Floats,
    job: Job,
    *,
    fraction: float = 1.0,
    noise_um: float = 0.1,
    tool_um: complex = 0j,
    placed: bool = True,
) -> tuple[Cause, ...]:
    """The causes of a part that has this left, after a cut by the model, with a gauge that has this noise."""
    noise = np.random.default_rng(4).normal(scale=noise_um, size=ANGLE_DEG.size)
    meta = MappingProxyType({"state": "free", "direction": "spindle", "start_mark": "spindle index"})
    trace = Trace(angle_deg=ANGLE_DEG, deviation_um=left_um + noise, meta=meta)
    target = target_path(job)
    cut = AppliedPath(path=CutPath(target=target, command=target), fraction=fraction, version=None)
    part = part_harmonics(trace, job, filter_upr=FILTER_UPR)
    return causes(part, cut, job, tool_um=tool_um, placed=placed)


@given(off_deg=st.floats(-50.0, 50.0), jaws=st.sampled_from([2, 3, 4]))
def test_a_jaw_that_is_elsewhere_is_named_with_its_angle(off_deg: float, jaws: int) -> None:
    job = filed(jaws)
    off_deg = off_deg * 3.0 / jaws
    if abs(off_deg) * jaws < 12.0:
        return
    first, *_ = said(lobe_um(job, further_deg=off_deg) - lobe_um(job), job)
    assert first.kind is CauseKind.ANGLE
    assert first.value == pytest.approx(off_deg, abs=0.5)


def test_a_jaw_25_degrees_off_is_also_seen_after_half_the_compensation() -> None:
    job = filed()
    first, *_ = said(lobe_um(job, further_deg=25.0) - 0.5 * lobe_um(job), job, fraction=0.5)
    assert first.kind is CauseKind.ANGLE
    assert first.value == pytest.approx(25.0, abs=0.5)


def test_a_lobe_that_stands_half_a_period_off_is_an_angle() -> None:
    job = filed()
    first, *_ = said(lobe_um(job, further_deg=60.0) - lobe_um(job), job)
    assert first.kind is CauseKind.ANGLE
    assert first.value == pytest.approx(60.0)


def test_a_tool_that_moves_the_wrong_way_is_named() -> None:
    job = filed()
    for fraction in (0.5, 1.0):
        first, *_ = said(lobe_um(job) * (1.0 + fraction), job, fraction=fraction)
        assert first.kind is CauseKind.SIGN
        assert first.um_pp == pytest.approx(fraction * 110.0, rel=0.01)


@pytest.mark.parametrize("arrives", [0.0, 0.3, 0.5, 0.7])
def test_a_path_that_arrives_in_part_is_named_with_the_part(arrives: float) -> None:
    job = filed()
    first, *_ = said(lobe_um(job) * (1.0 - arrives), job)
    assert first.kind is CauseKind.ARRIVES
    assert first.value == pytest.approx(arrives, abs=0.01)


@pytest.mark.parametrize("percent", [-20.0, -10.0, 10.0, 20.0])
def test_another_chucking_force_is_named_with_its_difference(percent: float) -> None:
    job = filed()
    first, *_ = said(lobe_um(job, larger=1.0 + percent / 100.0) - lobe_um(job), job)
    assert first.kind is CauseKind.FORCE
    assert 100.0 * first.value == pytest.approx(percent, abs=0.5)


@pytest.mark.parametrize("jaw", [1, 2, 3])
def test_a_jaw_that_presses_harder_is_named_with_its_number(jaw: int) -> None:
    """A ring under one more radial force: harmonics 1 / (n^2 - 1)^2, with a maximum at that jaw once released."""
    job = filed()
    at = np.radians(ANGLE_DEG - job.jaw_1_deg - (jaw - 1) * 120.0)
    harder_um = sum(3.0 * (9.0 / (n**2 - 1) ** 2) * np.cos(n * at) for n in range(2, 12))
    first, *_ = said(harder_um, job)
    assert (first.kind, first.order, first.jaw) == (CauseKind.JAW, 2, jaw)
    assert first.value == pytest.approx(0.0, abs=0.5)


def test_an_oval_blank_is_named_where_no_jaw_explains_it() -> None:
    job = filed()
    first, *_ = said(3.0 * np.cos(2.0 * np.radians(ANGLE_DEG - job.jaw_1_deg - 30.0)), job)
    assert (first.kind, first.order) == (CauseKind.OVAL, 2)
    assert first.um_pp == pytest.approx(6.0, abs=0.1)


def test_what_no_chuck_makes_is_named_by_its_order_and_overtones_are_the_chucks_own() -> None:
    job = filed()
    at = np.radians(ANGLE_DEG)
    found = said(4.0 * np.cos(5.0 * at) + 2.0 * np.cos(6.0 * at), job)
    assert [(each.kind, each.order) for each in found] == [(CauseKind.HARMONIC, 5), (CauseKind.OVERTONE, 6)]


def test_noise_is_called_noise() -> None:
    (only,) = said(np.zeros(ANGLE_DEG.size), filed(), noise_um=2.0)
    assert only.kind is CauseKind.NOISE


def test_the_largest_comes_first_and_the_smallest_are_left_out() -> None:
    job = filed()
    at = np.radians(ANGLE_DEG)
    left_um = lobe_um(job, larger=1.1) - lobe_um(job) + 6.0 * np.cos(2.0 * (at - np.radians(job.jaw_1_deg + 30.0)))
    found = said(left_um + 0.3 * np.cos(7.0 * at), job)
    assert [each.kind for each in found] == [CauseKind.OVAL, CauseKind.FORCE]


def test_an_angle_is_named_where_it_is_certain_and_explains_more_than_the_height() -> None:
    """Turned by 0.46 deg and 10 % high: of 27.5 um that is 0.7 um across and 2.75 um along."""
    job = filed()
    first, *_ = said(lobe_um(job, larger=1.1, further_deg=0.46) - lobe_um(job), job)
    assert first.kind is CauseKind.FORCE and first.value == pytest.approx(0.1, abs=0.01)
    first, *_ = said(lobe_um(job, larger=1.02, further_deg=2.0) - lobe_um(job), job)
    assert first.kind is CauseKind.ANGLE and first.value == pytest.approx(2.0, abs=0.05)
    assert abs(first.value) > 2.0 * first.sd
    for seed_um in (0.15, 0.2):  # 0.1 um is what a lathe does not repeat
        off_um = seed_um * np.sin(3.0 * np.radians(ANGLE_DEG - job.lobe_phase_deg))
        assert all(each.kind is not CauseKind.ANGLE for each in said(off_um, job, noise_um=0.01))


def test_what_the_tool_has_hidden_of_the_lobe_is_not_left() -> None:
    """The lobe is 20 % high, 11 um p-p, and the tool went 8 um p-p too deep in phase with it: 3 um are left."""
    job = filed()
    there = np.exp(-3j * np.radians(job.lobe_phase_deg))
    left_um = (
        lobe_um(job, larger=1.2) - lobe_um(job) - 4.0 * np.cos(3.0 * np.radians(ANGLE_DEG - job.lobe_phase_deg))
    )
    found = {each.kind: each for each in said(left_um, job, tool_um=complex(4.0 * there))}
    assert found[CauseKind.FORCE].value == pytest.approx(0.2, abs=0.01)
    assert found[CauseKind.FORCE].um_pp == pytest.approx(3.0, abs=0.1)


def test_without_an_angle_the_lobe_is_judged_by_its_height_whatever_the_tool_did() -> None:
    """9.7 um p-p, at the very angle at which the tool would explain all of it: the trace cannot know."""
    job = filed()
    left_um = 4.85 * np.cos(3.0 * np.radians(ANGLE_DEG))
    (only,) = said(left_um, job, tool_um=-4.85 + 0j, placed=False)
    assert (only.kind, only.order) == (CauseKind.UNPLACED, 3)
    assert only.um_pp == pytest.approx(9.7, abs=0.05)
