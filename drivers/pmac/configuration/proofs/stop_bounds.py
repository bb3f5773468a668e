"""How far an axis can go behind a stop, from Ix15 to Ix22 as they were read back, where that is possible."""

from __future__ import annotations

import math

from drivers.pmac.configuration.judged import Judged, JudgedAxis
from drivers.pmac.configuration.proofs.air_cut import air_cut
from drivers.pmac.configuration.stops import after_abort, after_jog_stop, jog_settings_of
from drivers.pmac.heartbeat.lease import LEASE_MS
from drivers.stop_record import Origin, Way
from drivers.travel import LINK_LATENCY_MS


def bound_counts(judged: Judged, axis: JudgedAxis, way: Way, origin: Origin, late_ms: float) -> float:
    """Return the longest way, counts, infinite where it does not follow from settings.

    `late_ms` is how old the look was, from which the way is counted, when the stop went out. What runs out behind
    a control-K, and how a cut is ended without a host, is measured alone.
    """
    late_ms += judged.machine.controller.background_ms + LINK_LATENCY_MS
    match way, origin:
        case Way.ABORT, Origin.JOG:
            return after_abort(jog_settings_of(judged, axis).speed, judged.of_motor(axis, 15), late_ms).counts
        case Way.ABORT, Origin.CUT:
            return _of_cut(judged, axis, late_ms)
        case Way.LEASE, Origin.JOG:
            return after_jog_stop(jog_settings_of(judged, axis), LEASE_MS + late_ms).counts
        case _:
            return math.inf


def _of_cut(judged: Judged, axis: JudgedAxis, late_ms: float) -> float:
    """The tool goes to and fro meanwhile: from one end of its lobe to the other at most, and on from there."""
    cut, rate = air_cut(judged.machine), judged.of_motor(axis, 15)
    speed = cut.speeds[axis.name]
    if axis.name == "tool":
        return 2.0 * cut.amplitude + after_abort(speed, rate, 0.0).counts
    return after_abort(speed, rate, late_ms).counts
