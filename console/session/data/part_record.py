"""A measured part as the record keeps it: its figures, and its whole trace as it was or would be in a file."""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

from console.session.data.run_log import shown
from profiles.roundness import RoundnessResult

Statement = tuple[str, tuple[object, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class PartRecord:
    """A measured part of a run; see `console.session.data.run_story.RecordedPart`, which is what is read of it.

    `trace` are the bytes of its trace's file.
    """

    ront_um: float
    trace: bytes = field(repr=False)
    data: Mapping[str, object]
    part: str = ""
    product: bool = True
    tolerance_um: float | None = None
    passed: bool | None = None
    diameter_mm: float | None = None
    nominal_diameter_mm: float | None = None
    diameter_tolerance_um: float | None = None
    lobe_um_pp: float | None = None
    trace_name: str | None = None


_SHOWN = ("reference_circle", "filter_upr", "state", "points", "eccentricity_um", "mean_deviation_um", "left_out")


def result_data(result: RoundnessResult) -> dict[str, object]:
    """Return the parameters and harmonics of a part; lengths in um, angles in degrees."""
    return {
        **{f"{name}_um": getattr(result, f"{name.lower()}_um") for name in ("RONt", "RONp", "RONv", "RONq")},
        **{name: getattr(result, name) for name in _SHOWN},
        "harmonics": [asdict(harmonic) for harmonic in result.harmonics],
    }


_COLUMNS = (
    "part",
    "product",
    "ront_um",
    "tolerance_um",
    "passed",
    "diameter_mm",
    "nominal_diameter_mm",
    "diameter_tolerance_um",
    "lobe_um_pp",
    "trace_name",
)
_NEXT = "SELECT coalesce(max(number), 0) FROM measurements WHERE run_id = ?"
_INSERT = (
    f"INSERT INTO measurements (run_id, number, at_utc, trace_sha256, data, {', '.join(_COLUMNS)})"
    f" SELECT ?, 1 + ({_NEXT}), ?, ?, ?, {', '.join('?' * len(_COLUMNS))}"
)


def measurement(run_id: str, at_utc: str, part: PartRecord | None) -> list[Statement]:
    """Return the statements that keep a part; none without one."""
    if part is None:
        return []
    values = (getattr(part, name) for name in _COLUMNS)
    plain = tuple(int(value) if isinstance(value, bool) else value for value in values)
    sha256 = hashlib.sha256(part.trace).hexdigest()
    return [
        (_INSERT, (run_id, run_id, at_utc, sha256, shown(part.data), *plain)),
        (f"INSERT INTO traces SELECT ?, ({_NEXT}), ?", (run_id, run_id, zlib.compress(part.trace, 6))),
    ]
