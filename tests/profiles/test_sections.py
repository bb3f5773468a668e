"""Sections of one part: a column of heights, points of a measuring machine, and files of one section each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from profiles.problem import ProfileError
from profiles.trace_files.sections import (
    SurfacePoints,
    parse_sections,
    parse_surface,
    read_sections,
    sections_content,
)

TURN_DEG = np.arange(0.0, 360.0, 5.0)


def lobed_um(z_mm: float) -> list[float]:
    return [round((30.0 - z_mm) * float(np.cos(3 * np.radians(angle))), 3) for angle in TURN_DEG]


def rows(heights: tuple[float, ...], separator: str = ",", decimal: str = ".") -> str:
    lines = []
    for z in heights:
        for angle, um in zip(TURN_DEG, lobed_um(z), strict=True):
            lines.append(separator.join(f"{each:g}".replace(".", decimal) for each in (z, angle, um)))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("header", "separator", "decimal"),
    [
        ("z_mm,angle_deg,deviation_um", ",", "."),
        ("Height [mm];Angle [deg];Deviation [µm]", ";", ","),
        ("높이 [mm]\t각도 [도]\t편차 [um]", "\t", "."),
    ],
)
def test_each_height_of_a_column_is_a_section(header: str, separator: str, decimal: str) -> None:
    text = f"# state: free\n{header}\n{rows((22.5, 26.0, 29.5), separator, decimal)}"
    found = parse_sections(text.encode())
    assert [each.z_mm for each in found] == [22.5, 26.0, 29.5]
    for section in found:
        assert section.z_mm is not None
        assert section.trace.deviation_um == pytest.approx(lobed_um(section.z_mm))
        assert section.trace.meta["state"] == "free"


def test_the_height_may_be_any_column_and_the_heights_in_any_order() -> None:
    points = [(a, um, z) for z in (29.0, 22.0) for a, um in zip(TURN_DEG, lobed_um(z), strict=True)]
    mixed = sorted(points)  # each angle of both heights beside each other
    text = "angle_deg,deviation_um,z_mm\n" + "".join(f"{a:g},{um:g},{z:g}\n" for a, um, z in mixed)
    assert {each.z_mm: float(np.ptp(each.trace.deviation_um)) for each in parse_sections(text.encode())} == {
        29.0: pytest.approx(2.0, abs=0.01),
        22.0: pytest.approx(16.0, abs=0.01),
    }


def test_points_of_a_measuring_machine_stand_about_one_axis() -> None:
    """Circles of 26 mm whose centres lean by 0.01 mm: seen from between them, off by half of it each way."""
    lines = ["x_mm,y_mm,z_mm"]
    for z, x0 in ((-10.0, 5.0), (-20.0, 5.01)):
        for angle in np.radians(TURN_DEG):
            lines.append(f"{x0 + 26 * np.cos(angle):.6f},{7 + 26 * np.sin(angle):.6f},{z:g}")
    below, above = sorted(parse_sections("\n".join(lines).encode()), key=lambda each: each.z_mm or 0.0)
    for section, off_um in ((below, 5.0), (above, -5.0)):
        assert section.trace.centre_mm == pytest.approx((5.005, 7.0), abs=1e-6)
        wanted = off_um * np.cos(np.radians(section.trace.angle_deg))
        assert section.trace.deviation_um == pytest.approx(wanted, abs=0.002)


def test_files_of_one_section_each_state_their_heights(tmp_path: Path) -> None:
    paths = []
    for z in (26.0, 22.5):
        path = tmp_path / f"{z}.csv"
        points = "".join(f"{a:g},{um:g}\n" for a, um in zip(TURN_DEG, lobed_um(z), strict=True))
        path.write_text(f"# z_mm: {z}\nangle_deg,deviation_um\n{points}", encoding="utf-8")
        paths.append(path)
    assert [each.z_mm for each in read_sections(paths)] == [22.5, 26.0]
    silent = tmp_path / "silent.csv"
    silent.write_text(paths[0].read_text(encoding="utf-8").partition("\n")[2], encoding="utf-8")
    assert [each.z_mm for each in read_sections([silent])] == [None], "one section alone need not"
    twice = tmp_path / "twice.csv"
    twice.write_bytes(paths[0].read_bytes())
    for refused, code in ((silent, "trace.no_height"), (twice, "trace.duplicate_height")):
        with pytest.raises(ProfileError) as caught:
            read_sections([*paths, refused])
        assert [each.code for each in caught.value.problems] == [code]


@pytest.mark.parametrize(
    ("line", "code"),
    [("x,5,1", "trace.not_number"), ("20000,5,1", "trace.out_of_range"), ("22.5,0,1", "trace.duplicate_angle")],
)
def test_a_line_without_a_height_is_named(line: str, code: str) -> None:
    text = "z_mm,angle_deg,deviation_um\n" + rows((22.5, 26.0)) + line + "\n"
    with pytest.raises(ProfileError) as caught:
        parse_sections(text.encode(), where="part.csv")
    (problem,) = caught.value.problems
    assert (problem.code, problem.where) == (code, f"part.csv:{2 + 2 * TURN_DEG.size}")


def table(points: list[tuple[float, float, float]]) -> bytes:
    lines = "".join(f"{z:.5f};{angle:g};{um:.4f}\n" for z, angle, um in points)
    return f"Z / mm;Angle [deg];Deviation [um]\n{lines}".encode()


def helix(turns: int = 12, *, folded: bool = False) -> list[tuple[float, float, float]]:
    """Z advances by half a mm a turn, one point each 5 degrees."""
    angles = np.arange(0.0, 360.0 * turns, 5.0)
    return [(20.0 + angle / 720.0, angle % 360.0 if folded else angle, 0.0) for angle in angles]


CAGE = [(z, angle, 0.0) for angle in range(0, 360, 45) for z in np.arange(20.0, 28.0, 0.1)]
SCATTERED = [(20.0 + 0.01 * (37 * k % 800), 360.0 * (k * 0.6180339 % 1.0), 0.0) for k in range(300)]


@pytest.mark.parametrize(
    ("points", "strategy", "code"),
    [
        (helix(), "helix", "trace.helix"),
        (helix(folded=True), "helix", "trace.helix"),
        (CAGE, "bird-cage", "trace.bird_cage"),
        (sorted(CAGE), "bird-cage", "trace.bird_cage"),
        (SCATTERED, "points", "trace.scattered"),
    ],
)
def test_points_that_are_no_sections_keep_their_strategy_and_have_no_roundness(
    points: list[tuple[float, float, float]], strategy: str, code: str
) -> None:
    found = parse_surface(table(points))
    assert isinstance(found, SurfacePoints)
    assert found.strategy == strategy
    assert found.z_mm == pytest.approx([z for z, *_ in points], abs=1e-5)
    assert found.angle_deg == pytest.approx([angle % 360.0 for _, angle, _ in points], abs=1e-3)
    with pytest.raises(ProfileError) as caught:
        parse_sections(table(points))
    assert [each.code for each in caught.value.problems] == [code]


def test_a_measuring_machine_need_not_come_to_the_same_height_for_each_point() -> None:
    off = np.random.default_rng(4).normal(0.0, 0.004, (2, TURN_DEG.size))
    points = [
        (z + dz, angle, 1.0)
        for z, row in zip((22.0, 26.0), off, strict=True)
        for angle, dz in zip(TURN_DEG, row, strict=True)
    ]
    found = parse_sections(table(points))
    assert [each.z_mm for each in found] == pytest.approx([22.0, 26.0], abs=0.002)
    assert [each.trace.angle_deg.size for each in found] == [TURN_DEG.size] * 2


def test_a_digit_that_is_wrong_in_one_height_is_named_with_its_line() -> None:
    lines = ("z_mm,angle_deg,deviation_um\n" + rows((22.5, 26.0))).split("\n")
    lines[40] = lines[40].replace("22.5", "82.5", 1)
    with pytest.raises(ProfileError) as caught:
        parse_sections("\n".join(lines).encode(), where="part.csv")
    (problem,) = caught.value.problems
    assert (problem.code, problem.where, problem.key) == ("trace.few_at_height", "part.csv:41", "Z 82.5 mm")


def test_sections_of_two_files_state_the_same_and_are_kept_in_one(tmp_path: Path) -> None:
    paths = []
    for z, mark in ((22.5, "jaw 1"), (26.0, "jaw 1"), (29.0, "spindle index")):
        paths.append(tmp_path / f"{z}.csv")
        points = "".join(f"{a:g},{um:g}\n" for a, um in zip(TURN_DEG, lobed_um(z), strict=True))
        paths[-1].write_text(
            f"# start_mark: {mark}\n# z_mm: {z}\nangle_deg,deviation_um\n{points}", encoding="utf-8"
        )
    for refused, code in ((paths[2], "trace.sections_differ"), (paths[0], "trace.duplicate_height")):
        with pytest.raises(ProfileError) as caught:
            read_sections([*paths[:2], refused])
        assert [each.code for each in caught.value.problems] == [code]
    both = read_sections(paths[:2])
    again = parse_sections(sections_content(both))
    for one, other in zip(both, again, strict=True):
        assert one.z_mm == other.z_mm
        assert np.array_equal(one.trace.deviation_um, other.trace.deviation_um)
        assert other.trace.meta == {"start_mark": "jaw 1"}


def test_a_height_that_is_there_twice_is_one_line_with_both_places() -> None:
    content = "z_mm,angle_deg,deviation_um\n" + rows((22.0, 24.0, 24.0, 26.0, 22.0))
    with pytest.raises(ProfileError) as refused:
        parse_sections(content.encode(), where="a")
    said = [(each.code, each.key, each.where, each.limit, each.value) for each in refused.value.problems]
    assert said == [
        ("trace.height_twice", "Z 22 mm", "a:290", "a:2", "72"),
        ("trace.height_twice", "Z 24 mm", "a:146", "a:74", "72"),
    ]


def test_heights_that_are_not_in_mm_are_refused_with_the_column() -> None:
    content = "Z [in],angle_deg,deviation_um\n" + rows((0.88, 1.0, 1.16))
    with pytest.raises(ProfileError) as refused:
        parse_sections(content.encode(), where="a")
    assert [(each.code, each.value, each.limit) for each in refused.value.problems] == [
        ("trace.height_unit", "z_in", "z_mm")
    ]
