"""Sections of a part unrolled over angle x Z: what is the part's stays, how it lay on the gauge does not."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from profiles.metrology.cylindricity import PartSection, evaluate_cylinder
from profiles.metrology.unrolled import MOST_KEPT, TURN_DEG, UnrolledPart, unroll, unroll_kept
from profiles.trace_files.sections import parse_sections

ANGLE_DEG = np.arange(0.0, 360.0, 0.5)


def section(z_mm: float, lobe_um: float = 0.0, mean_um: float = 0.0, tilt_um_per_mm: float = 0.0) -> PartSection:
    """Three lobes with a maximum at 20 degrees, about an axis that is tilted in the direction of 70 degrees."""
    lobe = lobe_um * np.cos(np.radians(3.0 * (ANGLE_DEG - 20.0)))
    tilt = tilt_um_per_mm * z_mm * np.cos(np.radians(ANGLE_DEG - 70.0))
    return PartSection(z_mm=z_mm, angle_deg=ANGLE_DEG, deviation_um=mean_um + lobe + tilt)


def unrolled(*sections: PartSection) -> UnrolledPart:
    return unroll(sections, None)


def test_a_round_straight_part_that_lies_askew_has_no_deviation() -> None:
    part = unrolled(*(section(z, mean_um=7.0, tilt_um_per_mm=0.5) for z in (30.0, 26.0, 22.0)))
    assert part.z_mm.tolist() == [22.0, 26.0, 30.0]
    assert np.abs(part.cylinder_um).max() < 1e-9
    assert np.abs(part.round_um).max() < 1e-9


def test_a_cone_is_round_in_each_section_and_no_cylinder() -> None:
    part = unrolled(*(section(z, mean_um=z) for z in (22.0, 26.0, 30.0)))
    assert np.abs(part.round_um).max() < 1e-9
    assert part.cylinder_um.mean(axis=1) == pytest.approx([-4.0, 0.0, 4.0])


def test_a_lobe_at_the_jaws_is_seen_there_alone_and_named_the_worst() -> None:
    """The axis of the minimum zone could tilt here: the lobe of one section determines the whole zone."""
    part = unrolled(*(section(z, lobe, tilt_um_per_mm=0.2) for z, lobe in ((22.0, 8.0), (26.0, 0.0), (30.0, 0.0))))
    assert part.worst == 0
    assert part.ront_um == pytest.approx([16.0, 0.0, 0.0], abs=1e-6)
    assert part.cylinder_um[0, 20] == pytest.approx(8.0)
    assert np.abs(part.cylinder_um[1:]).max() < 1e-6


def test_what_is_kept_gives_the_same_form() -> None:
    rng = np.random.default_rng(4)
    sections = [section(z, 0.3 * z, 2.0 * z, 0.1) for z in (22.0, 24.0, 26.0, 28.0, 30.0)]
    noisy = [
        PartSection(z_mm=s.z_mm, angle_deg=s.angle_deg, deviation_um=s.deviation_um + 0.2 * rng.normal(size=720))
        for s in sections
    ]
    part = unroll(noisy, 50.0)
    kept = unroll_kept(json.loads(json.dumps(part.event())))
    assert kept is not None and kept.ront_um.tolist() == part.ront_um.tolist()
    whole = evaluate_cylinder(noisy)
    assert part.ront_um == pytest.approx([each.ront_um for each in whole.sections], abs=1e-6)
    rows = zip(kept.z_mm.tolist(), kept.deviation_um, strict=True)
    again = evaluate_cylinder(
        [PartSection(z_mm=z, angle_deg=TURN_DEG, deviation_um=um) for z, um in rows], filter_upr=None
    )
    assert again.cylinder("MZCY").cylt_um == pytest.approx(whole.cylinder("MZCY").cylt_um, abs=0.05)


def test_of_many_sections_a_record_keeps_some_and_the_worst() -> None:
    part = unrolled(*(section(float(z), 5.0 if z == 38 else 1.0) for z in range(101)))
    kept = unroll_kept(part.event())
    assert kept is not None and kept.z_mm.size <= MOST_KEPT
    assert {0.0, 38.0, 100.0} <= set(kept.z_mm.tolist())
    assert kept.z_mm[kept.worst] == 38.0


ROW: dict[str, Any] = {"z_mm": 1.0, "RONt_um": 0.0, "deviation_um": [0.0] * 360}
ROWS = [ROW, {**ROW, "z_mm": 2.0}, {**ROW, "z_mm": 3.0}]


@pytest.mark.parametrize(
    "event",
    [
        {},
        {"profiles": 7},
        {"profiles": ROWS[:2]},
        {"profiles": [*ROWS[:2], ROW]},
        {"profiles": [*ROWS[:2], {**ROW, "z_mm": "3"}]},
        {"profiles": [*ROWS[:2], {**ROW, "z_mm": 3.0, "deviation_um": [0.0] * 359}]},
        {"profiles": [*ROWS[:2], {**ROW, "z_mm": 3.0, "deviation_um": [float("nan")] * 360}]},
        {"profiles": [{**each, "deviation_um": [0.0]} for each in ROWS]},
    ],
)
def test_a_damaged_record_has_no_sections(event: dict[str, Any]) -> None:
    assert unroll_kept({"profiles": ROWS}) is not None
    assert unroll_kept(event) is None


def test_an_exported_part_is_read_as_sections() -> None:
    part = unrolled(*(section(z, z) for z in (22.0, 26.0, 30.0)))
    found = parse_sections(part.table(simulated="yes").encode())
    assert [each.z_mm for each in found] == [22.0, 26.0, 30.0]
    assert found[1].trace.meta["simulated"] == "yes"
    assert found[1].trace.deviation_um.tolist() == part.deviation_um[1].tolist()
