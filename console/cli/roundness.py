"""`console roundness`: the roundness of a measured trace."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

from console.cli.output import print_json, roundness_fields
from console.cli.warn import tell
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.roundness import RoundnessResult, evaluate
from profiles.traces import Trace, read_trace

SHOWN_HARMONICS = (2, 3, 4, 5, 6, 7, 8, 9, 12, 15)


def main(options: Namespace, text: Catalogue) -> int:
    """Evaluate a trace and print its roundness; warnings go to stderr."""
    result, trace = _evaluated(options.file, options.filter)
    warnings = tell(result.warnings, text)
    if options.json:
        fields = {"file": options.file, **roundness_fields(result), "meta": dict(trace.meta)}
        print_json({**fields, "warnings": warnings})
        return 0
    print("\n".join(_lines(result, text)))
    return 0


def _evaluated(file: str, filter_upr: float | None) -> tuple[RoundnessResult, Trace]:
    """Return the result with every warning, and the trace; every problem names the file."""
    where = printable(file)
    trace = read_trace(Path(file))
    radius_mm, unusable = _radius_mm(trace)
    state = trace.meta.get("state", "unknown")
    try:
        result = evaluate(trace.angle_deg, trace.deviation_um, filter_upr, state=state, radius_mm=radius_mm)
    except ProfileError as error:
        raise ProfileError(*(replace(problem, where=where) for problem in error.problems)) from error
    warnings = (replace(problem, where=where) for problem in (*unusable, *result.warnings))
    return replace(result, warnings=tuple(warnings)), trace


def _radius_mm(trace: Trace) -> tuple[float | None, tuple[Problem, ...]]:
    """Return the radius that the trace states, None where it states none, with a warning where it is no radius."""
    stated = trace.meta.get("radius_mm")
    if stated is None:
        return None, ()
    try:
        radius_mm = float(stated)
    except ValueError:
        radius_mm = math.nan
    if math.isfinite(radius_mm) and radius_mm > 0.0:
        return radius_mm, ()
    shown = printable(stated, 60) or '""'
    return None, (Problem(code="trace.radius", key="radius_mm", value=shown, limit="> 0 mm"),)


def _lines(result: RoundnessResult, text: Catalogue) -> list[str]:
    filtered = f"{result.filter_upr:g} UPR" if result.filter_upr is not None else text("roundness.no_filter")
    head = text("roundness.head", circle=result.reference_circle, filter=filtered, points=result.points)
    state = text(
        "roundness.state", state=text(f"state.{result.state}") if result.state in _STATES else result.state
    )
    rows = [
        ("RONt", f"{result.ront_um:z.3f}", "um"),
        ("RONp", f"{result.ronp_um:z.3f}", "um"),
        ("RONv", f"{result.ronv_um:z.3f}", "um"),
        ("RONq", f"{result.ronq_um:z.3f}", "um"),
        (text("roundness.eccentricity"), f"{result.eccentricity_um:z.3f}", "um"),
    ]
    shown = [h for h in result.harmonics if h.n in SHOWN_HARMONICS]
    waves = [(text("roundness.n"), text("roundness.amplitude"), text("roundness.crest"))]
    waves += [(str(h.n), f"{h.amplitude_um:z.3f} um", f"{h.phase_deg:z.2f} deg") for h in shown]
    return [head, state, "", *table(rows, numeric=(1,)), "", *table(waves, numeric=(0, 1, 2))]


_STATES = ("free", "clamped", "unknown")
