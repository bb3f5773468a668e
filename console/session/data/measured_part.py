"""A measured part of a run as the record keeps it: its figures, its verdict, and its whole trace."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from profiles.traces import Trace, parse_trace

if TYPE_CHECKING:
    from profiles.roundness import RoundnessResult

UNDATED = datetime.min.replace(tzinfo=UTC)

COLUMNS = (
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
"""Columns of `measurements` that are fields of `RecordedPart`."""

_BOOLEAN = ("product", "passed")


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedPart:
    """A measured part of a run.

    `part` names it among those of its run, empty for the only one; `product` is False of one that was cut for
    comparison. `data` has the parameters, the harmonics ("harmonics": n, amplitude_um, phase_deg) and the proposed
    learning step ("learning"). `trace` are the bytes of the trace's file, as `profiles.traces.parse_trace` takes
    them; None where it was not kept or cannot be read. `trace_name` is that of an imported file. `number`, `at`
    and `trace_sha256` are given by the record.
    """

    ront_um: float
    part: str = ""
    product: bool = True
    tolerance_um: float | None = None
    passed: bool | None = None
    diameter_mm: float | None = None
    nominal_diameter_mm: float | None = None
    diameter_tolerance_um: float | None = None
    lobe_um_pp: float | None = None
    trace_name: str | None = None
    trace: bytes | None = field(default=None, repr=False)
    data: Mapping[str, Any] = field(default_factory=dict)
    number: int = 0
    at: datetime = UNDATED
    trace_sha256: str | None = None

    @property
    def is_round(self) -> bool | None:
        """Whether RONt is within its tolerance; the verdict where no tolerance is recorded."""
        return self.passed if self.tolerance_um is None else self.ront_um <= self.tolerance_um

    @property
    def off_nominal_um(self) -> float | None:
        """How much the mean diameter is larger than the nominal one, um; None where either is not known."""
        if self.diameter_mm is None or self.nominal_diameter_mm is None:
            return None
        return 1000.0 * (self.diameter_mm - self.nominal_diameter_mm)

    @property
    def is_of_size(self) -> bool | None:
        """Whether the mean diameter is within its tolerance; None without a diameter or a tolerance."""
        off_um, most_um = self.off_nominal_um, self.diameter_tolerance_um
        return None if off_um is None or most_um is None else abs(off_um) <= most_um

    def read_trace(self) -> Trace | None:
        """Parse the trace, with the operator's answers in its header; None without one. ProfileError."""
        if self.trace is None:
            return None
        trace, answers = parse_trace(self.trace, where=self.trace_name or ""), self.data.get("answers")
        given = {k: v for k, v in answers.items() if isinstance(v, str)} if isinstance(answers, Mapping) else {}
        return replace(trace, meta=MappingProxyType({**trace.meta, **given}))


@dataclass(frozen=True, slots=True, kw_only=True)
class PartPoint(RecordedPart):
    """A measured product of a job: a point of a run chart; without its trace and its data.

    `lobe_um_pp` is its harmonic at the number of jaws; `compensation` and `inverted` are those of `RunRow`.
    """

    run_id: str
    strategy: str
    stage: str | None
    compensation: str | None
    inverted: str | None = None


def column_values(columns: Iterable[Any]) -> dict[str, Any]:
    """Return the values of `COLUMNS`, as read from the file, by their names."""
    found = dict(zip(COLUMNS, columns, strict=True))
    return {k: bool(v) if k in _BOOLEAN and v is not None else v for k, v in found.items()}


_SHOWN = ("reference_circle", "filter_upr", "state", "points", "eccentricity_um", "mean_deviation_um", "left_out")


def result_data(result: RoundnessResult) -> dict[str, object]:
    """Return the parameters and harmonics of a part; lengths in um, angles in degrees."""
    return {
        **{f"{name}_um": getattr(result, f"{name.lower()}_um") for name in ("RONt", "RONp", "RONv", "RONq")},
        **{name: getattr(result, name) for name in _SHOWN},
        "harmonics": [asdict(harmonic) for harmonic in result.harmonics],
    }
