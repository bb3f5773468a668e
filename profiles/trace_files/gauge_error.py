"""Readings of a gauge without the error of its spindle; their header says so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TypeVar

from profiles.arrays import read_only
from profiles.metrology.cylindricity import PartSection
from profiles.metrology.harmonics import harmonic
from profiles.metrology.separation import GaugeError
from profiles.trace_files.header import GAUGE_ERROR
from profiles.trace_files.sections import SurfacePoints
from profiles.traces import Trace

Reading = TypeVar("Reading", Trace, SurfacePoints)


def take_error_off(reading: Reading, error: GaugeError | None) -> Reading:
    """Return a reading without the error of its gauge; as it is without one, or if it is free of one already."""
    if error is None or GAUGE_ERROR in reading.meta:
        return reading
    own_um = read_only(reading.deviation_um - error.at_um(reading.angle_deg))
    meta = MappingProxyType({**reading.meta, GAUGE_ERROR: spell_error(error)})
    return replace(reading, deviation_um=own_um, meta=meta)


def sections_without(sections: Sequence[PartSection], error: GaugeError | None) -> tuple[PartSection, ...]:
    """Return sections without the error of their gauge, at the angles of which they are."""
    if error is None:
        return tuple(sections)
    return tuple(replace(s, deviation_um=read_only(s.deviation_um - error.at_um(s.angle_deg))) for s in sections)


def spell_error(error: GaugeError) -> str:
    """Return name, date and orders, so that a reading can be had back, and where it is blind."""
    waves = (harmonic(each.upr, each.cosine_um, each.sine_um) for each in error.proven)
    words = ", ".join(f"{w.n} UPR {w.amplitude_um:.3f} um at {w.phase_deg:.1f} deg" for w in waves)
    blind = f" (blind at {', '.join(map(str, error.blind))} UPR)" if error.blind else ""
    return f"{error.gauge} {error.date}: {words or '0 um'}{blind}"
