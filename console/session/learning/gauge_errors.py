"""The gauge's own error on disk: a calibration of the gauge by its name, taken off what that gauge reads later."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import date, timedelta
from itertools import combinations
from pathlib import Path

from console.session.data.calibrations import Calibration, newest, record_problem, store
from console.session.data.kept_files import utc_now
from console.session.gauge_in_use import gauge_in_use
from profiles.files import printable
from profiles.gauge import GaugeProfile
from profiles.metrology.harmonics import HIGHEST_HARMONIC
from profiles.metrology.separation import SURE, VALID_DAYS, GaugeError, Separation, is_same_reading
from profiles.metrology.uncertainty import KnownGauge
from profiles.problem import Problem, ProfileError
from profiles.strict_values import record
from profiles.trace_files.gauge_error import spell_error, take_error_off
from profiles.trace_files.header import GAUGE_ERROR, MOST_OFF_SIZE_MM, TraceHeader, header_of
from profiles.trace_files.sections import SurfacePoints, TraceSection
from profiles.traces import Trace

KIND = "gauge-error"
ORDERS = range(2, HIGHEST_HARMONIC + 1)  # that a separation finds
LEAST_UM = 0.001  # of a gauge's error where its file declares none: the last decimal that is shown


def refuse_unlike(placed: Sequence[tuple[str, Trace]]) -> None:
    """Refuse readings, each with the name of its file, that are not several placements of one part.

    Raises ProfileError: `separation.same_file`, the same reading twice but for rounding, so that all of it
    would be the gauge's error; `separation.corrected`, an error of the gauge was taken off it;
    `separation.unlike`, the headers state another part, state or direction.
    """
    for name, trace in placed:
        if (off := trace.meta.get(GAUGE_ERROR)) is not None:
            value = printable(off)
            raise ProfileError(Problem(code="separation.corrected", where=printable(name), value=value))
    for (first, one), (name, other) in combinations(placed, 2):
        if is_same_reading(one.deviation_um, other.deviation_um):
            raise ProfileError(Problem(code="separation.same_file", where=printable(name), value=printable(first)))
        for key, both in _unlike(header_of(one.meta)[0], header_of(other.meta)[0]).items():
            value, limit = (printable(str(each)) for each in both)
            where = printable(name)
            raise ProfileError(Problem(code="separation.unlike", where=where, key=key, value=value, limit=limit))


def _unlike(one: TraceHeader, other: TraceHeader) -> dict[str, tuple[object, object]]:
    """Return what two headers of one part state differently: values of the second and of the first, by key."""
    found: dict[str, tuple[object, object]] = {}
    if one.state != other.state and "unknown" not in (one.state, other.state):
        found["state"] = other.state, one.state
    if one.direction and other.direction and one.against_spindle != other.against_spindle:
        found["direction"] = other.direction, one.direction
    if one.radius_mm and other.radius_mm and abs(one.radius_mm - other.radius_mm) > MOST_OFF_SIZE_MM:
        found["radius_mm"] = other.radius_mm, one.radius_mm
    return found


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
        if wrong := [each for each in error.orders if each.sd_um < 0.0 or each.upr not in ORDERS]:
            raise ValueError(f"upr {wrong[0].upr}, sd_um {wrong[0].sd_um:g}")
    except (TypeError, ValueError, OverflowError) as wrong:
        raise record_problem(file, str(wrong)) from wrong
    return error


def simulated_gauge(lathe: object) -> str:
    """Return the name of the gauge of a simulated lathe: each has one of its own."""
    return f"simulated-gauge {lathe}"


def known_gauge(data: Path, gauge: GaugeProfile, lathe: str = "") -> KnownGauge:
    """Return a gauge with the error kept of it, else with that of the gauge of a simulated `lathe`, if any.

    Raises ProfileError: `gauge.error_outdated`, after the last day of the error; as `newest_error`.
    """
    error = newest_error(data, gauge.name)
    if error is None and lathe:
        error = newest_error(data, simulated_gauge(lathe))
    if error is not None and is_outdated(error):
        raise ProfileError(Problem(code="gauge.error_outdated", key=error.gauge, value=error.valid_until))
    return KnownGauge(profile=gauge, error=error)


def error_in_use(data: Path, machine: str, *, simulated: bool) -> GaugeError | None:
    """Return the error kept of the gauge that reads the files of a machine, None without one.

    Files of a simulated lathe are of its own gauge. Raises ProfileError: as `gauge_in_use` and `newest_error`.
    """
    gauge = None if simulated else gauge_in_use(data, machine)
    return None if gauge is None else newest_error(data, gauge.name)


def is_outdated(error: GaugeError) -> bool:
    """Whether the last day of an error is over."""
    return bool(error.valid_until) and utc_now()[:10] > error.valid_until


def error_told(error: GaugeError | None) -> tuple[Problem, ...]:
    """Return that the error of a gauge was taken off, and what it is; or that it is too old for that."""
    if error is None:
        return ()
    if is_outdated(error):
        return (Problem(code="gauge.error_expired", key=error.gauge, value=error.valid_until),)
    words = spell_error(error).removeprefix(f"{error.gauge} ")
    return (Problem(code="gauge.error_off", key=error.gauge, value=words),)


def spindle_told(gauge: KnownGauge | None) -> tuple[Problem, ...]:
    """Return that nobody knows the error of the gauge's spindle, or that its file says less."""
    if gauge is None or gauge.error is not None:
        return () if gauge is None else undeclared_error(gauge.profile, gauge.error)
    own = gauge.profile
    is_stated = own.spindle_error_um is not None or own.roundness_u_um is not None
    return () if is_stated else (Problem(code="gauge.spindle_unknown", key=own.name),)


def undeclared_error(gauge: GaugeProfile, error: GaugeError | None) -> tuple[Problem, ...]:
    """Return where a separation finds more than the file of the gauge declares, beyond its own uncertainty."""
    declared_um, only_upr = gauge.spindle_error_um, gauge.spindle_error_upr
    if gauge.roundness_u_um is not None:  # RONt of a wave is twice its amplitude
        declared_um, only_upr = 0.5 * gauge.roundness_u_um, None
    if error is None or declared_um is None:
        return ()
    found = list[str]()
    for each in error.orders:
        um, unsure_um = math.hypot(each.cosine_um, each.sine_um), SURE * each.sd_um
        if um - unsure_um > (declared_um if only_upr in (None, each.upr) else LEAST_UM):
            found.append(f"{each.upr} UPR {um:.3f} ± {unsure_um:.3f} um")
    limit = f"{declared_um:g} um" + ("" if only_upr is None else f" ({only_upr} UPR)")
    told = Problem(code="gauge.undeclared", key=gauge.name, value=", ".join(found), limit=limit)
    return (told,) if found else ()


def without_gauge_error(trace: Trace, error: GaugeError | None) -> tuple[Trace, tuple[Problem, ...]]:
    """Return a reading without the error of its gauge, and what is to be told of that.

    It is as it was without an error, after its last day (`gauge.error_expired`), and if it is free of one already.
    """
    if error is None or GAUGE_ERROR in trace.meta:
        return trace, ()
    return trace if is_outdated(error) else take_error_off(trace, error), error_told(error)


def filed_without_error(
    filed: tuple[TraceSection, ...] | SurfacePoints, error: GaugeError | None
) -> tuple[tuple[TraceSection, ...] | SurfacePoints, tuple[Problem, ...]]:
    """Return what is in a file without the error of its gauge, and what is to be told of that, as for a trace."""
    meta = filed.meta if isinstance(filed, SurfacePoints) else filed[0].trace.meta
    if error is None or GAUGE_ERROR in meta:
        return filed, ()
    if not is_outdated(error):
        if isinstance(filed, SurfacePoints):
            filed = take_error_off(filed, error)
        else:
            filed = tuple(replace(each, trace=take_error_off(each.trace, error)) for each in filed)
    return filed, error_told(error)


def error_drift(error: GaugeError, last: GaugeError) -> tuple[Problem, ...]:
    """Return what to tell of a change since the last separation; nothing within the scatter of both."""
    moved = spell_drift(error.drift_um(last))
    return (Problem(code="gauge.error_drifted", key=error.gauge, value=moved, limit=last.date),) if moved else ()


def spell_drift(drift_um: Mapping[int, float]) -> str:
    """Return the change of each order in words, "" without any."""
    return ", ".join(f"{n} UPR {um:.3f} um" for n, um in drift_um.items())
