"""Tables that are sent, in the order in which they refer to each other, with their columns as at the lathe."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class SentTable:
    """A table: `columns` are the same at the lathe and in the shop. A `shared` one is not of one lathe alone."""

    name: str
    columns: tuple[str, ...]
    shared: bool = False


TEXTS = SentTable("texts", ("sha256", "content"), shared=True)
RUNS = SentTable(
    "runs",
    (
        *("run_id", "started_utc", "software", "job", "job_sha256", "machine", "machine_sha256", "simulated"),
        *("strategy", "program", "job_text_sha256", "machine_text_sha256", "python", "controller", "family"),
        *("stage", "compensation", "operator", "tolerance_um", "setup"),
    ),
)
EVENTS = SentTable("events", ("run_id", "number", "at_utc", "kind", "data"))
MEASUREMENTS = SentTable(
    "measurements",
    (
        *("run_id", "number", "at_utc", "part", "product", "ront_um", "tolerance_um", "passed", "diameter_mm"),
        *("nominal_diameter_mm", "diameter_tolerance_um", "lobe_um_pp", "trace_sha256", "trace_name", "data"),
    ),
)
TRACES = SentTable("traces", ("run_id", "number", "content"))
TELEMETRY = SentTable("telemetry", ("run_id", "number", "part", "kind", "begun_utc", "data"))

SENT = (TEXTS, RUNS, EVENTS, MEASUREMENTS, TRACES, TELEMETRY)


def mark_of(values: Sequence[Any]) -> str:
    """Return what tells a row from any other that could stand in its place: a hash of its values."""
    return hashlib.sha256(repr(tuple(values)).encode("utf-8", "backslashreplace")).hexdigest()[:16]
