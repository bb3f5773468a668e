"""UTF-16 without a byte order mark is named as such in one sentence, by every reader of a text from outside."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from console.text.catalogue import load
from profiles.calibration.table import read_table
from profiles.fingerprint.readings import read_readings
from profiles.problem import ProfileError
from profiles.store import BUNDLED_JOBS, load_job, load_machine
from profiles.traces import read_trace

TRACE = "# state: free\nangle_deg,deviation_um\n" + "".join(f"{a},{a % 7}\n" for a in range(360))
JOB = (BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
@pytest.mark.parametrize(
    ("read", "text"),
    [
        (read_trace, TRACE),
        (read_readings, "# fingerprint: 1\nangle_deg,reading_um\n0,1\n"),
        (read_table, "torque_n_m,force_n\n1,2\n"),
        (lambda path: load_job(str(path)), JOB),
        (lambda path: load_machine(str(path)), "schema = 1\n"),
    ],
    ids=["trace", "fingerprint", "calibration", "job", "machine"],
)
def test_a_text_in_utf_16_is_told_to_be_saved_as_utf_8(
    read: Callable[[Path], object], text: str, encoding: str, tmp_path: Path
) -> None:
    path = tmp_path / "part.toml"
    path.write_bytes(text.encode(encoding))
    with pytest.raises(ProfileError) as caught:
        read(path)
    (problem,) = caught.value.problems
    assert problem.code == "file.nul_bytes"
    assert "part.toml" in problem.where
    for language in ("en", "ko"):
        said = load(language).problem(problem)
        assert "UTF-8" in said and "UTF-16" in said and "\\x00" not in said


def test_with_a_byte_order_mark_a_trace_is_read_as_before(tmp_path: Path) -> None:
    path = tmp_path / "part.csv"
    path.write_bytes(TRACE.encode("utf-16"))
    assert read_trace(path).angle_deg.size == 360
