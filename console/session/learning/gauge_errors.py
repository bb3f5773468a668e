"""The gauge's own error on disk: a calibration of the gauge by its name, taken off what that gauge reads later."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import date, timedelta
from pathlib import Path
from types import MappingProxyType

from console.session.data.calibrations import Calibration, newest, record_problem, store
from console.session.data.kept_files import utc_now
from profiles.arrays import read_only
from profiles.metrology.harmonics import harmonic
from profiles.metrology.separation import VALID_DAYS, GaugeError, Separation
from profiles.problem import Problem
from profiles.strict_values import record
from profiles.trace_files.header import GAUGE_ERROR
from profiles.traces import Trace

KIND = "gauge-error"


def keep_error(
    data: Path, gauge: str, found: Separation, files: Sequence[tuple[str, bytes]]
) -> tuple[Path, GaugeError]:
    """Keep the error of a gauge, found today by readings in `files`, their names and contents.

    Raises ProfileError: as `calibrations.store`.
    """
    today = utc_now()[:10]
    until = date.fromisoformat(today) + timedelta(days=VALID_DAYS)
    error = found.error_of(gauge, today, until.isoformat())
    digest = hashlib.sha256(b"".join(content for _, content in files)).hexdigest()
    calibration = Calibration(
        kind=KIND,
        subject=gauge,
        subject_sha256="",
        date=utc_now(),
        file=", ".join(name for name, _ in files),
        file_sha256=digest,
        found=asdict(error),
    )
    return store(data, calibration), error


def newest_error(data: Path, gauge: str) -> GaugeError | None:
    """Return the newest error that is kept of a gauge, None without; ProfileError as `calibrations.load`."""
    if (kept := newest(data, gauge, KIND, "")) is None:
        return None
    file, calibration = kept
    try:
        error = record(GaugeError, calibration.found)
        date.fromisoformat(error.valid_until)
    except (TypeError, ValueError, OverflowError) as wrong:
        raise record_problem(file, str(wrong)) from wrong
    return error


def without_gauge_error(trace: Trace, error: GaugeError | None) -> tuple[Trace, tuple[Problem, ...]]:
    """Return a reading without the error of its gauge, and what is to be told of that.

    It is as it was without an error, after its last day (`gauge.error_expired`), and if it is free of one already.
    """
    if error is None or GAUGE_ERROR in trace.meta:
        return trace, ()
    if error.valid_until and utc_now()[:10] > error.valid_until:
        return trace, (Problem(code="gauge.error_expired", key=error.gauge, value=error.valid_until),)
    words = spell_error(error)
    corrected = replace(
        trace,
        deviation_um=read_only(trace.deviation_um - error.at_um(trace.angle_deg)),
        meta=MappingProxyType({**trace.meta, GAUGE_ERROR: words}),
    )
    return corrected, (
        Problem(code="gauge.error_off", key=error.gauge, value=words.removeprefix(f"{error.gauge} ")),
    )


def error_drift(error: GaugeError, last: GaugeError) -> tuple[Problem, ...]:
    """Return what to tell of a change since the last separation; nothing within the scatter of both."""
    moved = spell_drift(error.drift_um(last))
    return (Problem(code="gauge.error_drifted", key=error.gauge, value=moved, limit=last.date),) if moved else ()


def spell_drift(drift_um: Mapping[int, float]) -> str:
    """Return the change of each order in words, "" without any."""
    return ", ".join(f"{n} UPR {um:.3f} um" for n, um in drift_um.items())


def spell_error(error: GaugeError) -> str:
    """Return name, date and orders, so that a reading can be had back, and where it is blind."""
    waves = (harmonic(each.upr, each.cosine_um, each.sine_um) for each in error.proven)
    words = ", ".join(f"{w.n} UPR {w.amplitude_um:.3f} um at {w.phase_deg:.1f} deg" for w in waves)
    blind = f" (blind at {', '.join(map(str, error.blind))} UPR)" if error.blind else ""
    return f"{error.gauge} {error.date}: {words or '0 um'}{blind}"
