"""The file of indicator readings of a clamping: what it says, and what is refused, with line and column."""

from __future__ import annotations

from pathlib import Path

import pytest

from profiles.fingerprint.readings import parse_readings, read_readings, readings_text
from profiles.problem import ProfileError

HEAD = """\
# fingerprint: 1
# units: um
# angle_zero: spindle index
# direction: spindle
# positive: outward
"""
COLUMNS = "angle_deg,finger_tight_um,full_force_um\n"
ROWS = "".join(f"{angle},{angle / 100:g},-30\n" for angle in range(0, 360, 45))


def refusals(text: str | bytes) -> list[tuple[str, str]]:
    """Return code and place of every refusal of a file."""
    with pytest.raises(ProfileError) as refused:
        parse_readings(text.encode() if isinstance(text, str) else text, "f.csv")
    return [(each.code, each.where) for each in refused.value.problems]


def test_a_file_is_read_as_it_was_written() -> None:
    more = HEAD.replace("spindle index", "jaw 1").replace("outward", "inward")
    more += "# graduation_um: 2\n# finger_force_n: 60\n# note: third shift\n"
    found = parse_readings((more + COLUMNS + ROWS).encode())
    assert found.angle_deg == tuple(range(0, 360, 45))
    assert found.finger_um[2] == 0.9 and set(found.full_um) == {-30.0}
    assert (found.from_jaw_1, found.inward, found.against) == (True, True, False)
    assert (found.graduation_um, found.finger_force_n, found.simulated) == (2.0, 60.0, False)
    assert parse_readings(readings_text(found).encode()) == found


@pytest.mark.parametrize(
    "content", [f"\ufeff{HEAD}\n{COLUMNS}\n{ROWS}\n\n", (HEAD + COLUMNS + ROWS).replace("\n", "\r\n")]
)
def test_editors_may_leave_their_marks(content: str) -> None:
    assert parse_readings(content.encode()).places == 8


@pytest.mark.parametrize(
    ("before", "after", "refused"),
    [
        ("# fingerprint: 1", "# fingerprint: 2", [("clamping.schema", "f.csv:1:16")]),
        ("# units: um", "# units: mm", [("clamping.value", "f.csv:2:10")]),
        ("# units: um\n", "", [("clamping.missing", "f.csv")]),
        ("# units: um", "# unit: um", [("clamping.missing", "f.csv"), ("clamping.unknown_key", "f.csv:2:3")]),
        ("# units: um", "# units: um\n# units: um", [("clamping.meta", "f.csv:3:3")]),
        ("# units: um", "# units: um\n# graduation_um: 0", [("clamping.value", "f.csv:3:18")]),
        ("# units: um", "# units: um\n# graduation_um: nan", [("clamping.value", "f.csv:3:18")]),
        ("full_force_um", "full_um", [("clamping.columns", "f.csv:6:1")]),
        ("90,0.9,-30", "90,0.9", [("clamping.cells", "f.csv:9:7")]),
        ("90,0.9,-30", "90,0.9,-30,4", [("clamping.cells", "f.csv:9:11")]),
        ("90,0.9,-30", "90,0.9,-3x", [("clamping.cell", "f.csv:9:8")]),
        ("90,0.9,-30", "90, 1e3,-30", [("clamping.cell", "f.csv:9:5")]),
        ("90,0.9,-30", "360,0.9,-30", [("clamping.cell", "f.csv:9:1")]),
        ("90,0.9,-30", "90,0.9,5001", [("clamping.cell", "f.csv:9:8")]),
        ("0,0,-30\n45,0.45,-30\n90,0.9,-30\n", "", [("clamping.few_places", "f.csv")]),
        (COLUMNS + ROWS, "", [("clamping.columns", "f.csv")]),
    ],
)
def test_a_mistake_is_refused_with_its_place(before: str, after: str, refused: list[tuple[str, str]]) -> None:
    text = HEAD + COLUMNS + ROWS
    assert before in text
    assert refusals(text.replace(before, after)) == refused


def test_all_mistakes_come_at_once_but_not_by_the_thousand() -> None:
    assert len(refusals(HEAD + COLUMNS + "x,y,z\n" * 1000)) < 30
    assert refusals(b"\xff\xfe\xff") and refusals(b"") and refusals(b"\xff# fingerprint: 1")


def test_a_path_may_name_anything(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.csv"):
        with pytest.raises(ProfileError) as refused:
            read_readings(path)
        assert refused.value.problems[0].code == "clamping.unreadable"
