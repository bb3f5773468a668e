"""`console roundness`: the roundness of a measured trace."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from console.cli.output import print_json, roundness_fields
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.roundness import RoundnessResult, evaluate
from profiles.traces import Trace, read_trace

SHOWN_HARMONICS = (2, 3, 4, 5, 6, 7, 8, 9, 12, 15)


def main(options: Namespace, text: Catalogue) -> int:
    """Evaluate a trace and print its roundness."""
    trace = read_trace(Path(options.file))
    result = evaluate(
        trace.angle_deg,
        trace.deviation_um,
        options.filter,
        state=trace.meta.get("state", "unknown"),
        radius_mm=_radius_mm(trace),
    )
    warnings = [text.problem(problem) for problem in result.warnings]
    if options.json:
        fields = {"file": options.file, **roundness_fields(result), "meta": dict(trace.meta)}
        print_json({**fields, "warnings": warnings})
        return 0
    print("\n".join([*_lines(result, text), *warnings]))
    return 0


def _radius_mm(trace: Trace) -> float | None:
    """Return the radius that the trace states, None where it states none that can be used."""
    try:
        radius_mm = float(trace.meta.get("radius_mm", ""))
    except ValueError:
        return None
    return radius_mm if radius_mm > 0.0 else None


def _lines(result: RoundnessResult, text: Catalogue) -> list[str]:
    filtered = f"{result.filter_upr:g} UPR" if result.filter_upr is not None else text("roundness.no_filter")
    head = text("roundness.head", circle=result.reference_circle, filter=filtered, points=result.points)
    state = text(
        "roundness.state", state=text(f"state.{result.state}") if result.state in _STATES else result.state
    )
    rows = [
        ("RONt", f"{result.ront_um:.3f}", "um"),
        ("RONp", f"{result.ronp_um:.3f}", "um"),
        ("RONv", f"{result.ronv_um:.3f}", "um"),
        ("RONq", f"{result.ronq_um:.3f}", "um"),
        (text("roundness.eccentricity"), f"{result.eccentricity_um:.3f}", "um"),
    ]
    shown = [h for h in result.harmonics if h.n in SHOWN_HARMONICS]
    waves = [(text("roundness.n"), text("roundness.amplitude"), text("roundness.crest"))]
    waves += [(str(h.n), f"{h.amplitude_um:.3f} um", f"{h.phase_deg:.2f} deg") for h in shown]
    return [head, state, "", *table(rows, numeric=(1,)), "", *table(waves, numeric=(0, 1, 2))]


_STATES = ("free", "clamped", "unknown")
