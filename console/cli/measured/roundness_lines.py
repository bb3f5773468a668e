"""Roundness of a trace as lines for people."""

from __future__ import annotations

from console.cli.measured.measured_trace import MeasuredTrace
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.roundness import RoundnessResult

SHOWN_HARMONICS = (2, 3, 4, 5, 6, 7, 8, 9, 12, 15)
_STATES = ("free", "clamped", "unknown")


def roundness_lines(measured: MeasuredTrace, text: Catalogue) -> list[str]:
    """Return head, figures, the four circles, size, turns and harmonics."""
    result = measured.result
    rows = [
        ("RONt", f"{result.ront_um:z.3f}", "um"),
        ("RONp", f"{result.ronp_um:z.3f}", "um"),
        ("RONv", f"{result.ronv_um:z.3f}", "um"),
        ("RONq", f"{result.ronq_um:z.3f}", "um"),
        (text("roundness.eccentricity"), f"{result.eccentricity_um:z.3f}", "um"),
    ]
    circles = [(text("roundness.circle"), "RONt", text("roundness.centre_x"), text("roundness.centre_y"))]
    circles += [
        (c.kind, f"{c.ront_um:z.3f} um", f"{c.centre_x_um:z.3f} um", f"{c.centre_y_um:z.3f} um")
        for c in result.circles
    ]
    blocks = [
        _head(measured, text),
        table([*rows, *_size(measured, text)], numeric=(1,)),
        table(circles, numeric=(1, 2, 3)),
        _harmonics(measured, text),
    ]
    return [line for block in blocks for line in (*block, "")][:-1]


def _head(measured: MeasuredTrace, text: Catalogue) -> list[str]:
    result, header = measured.result, measured.header
    lines = [
        text(
            "roundness.head",
            circle=result.reference_circle,
            filter=filter_line(result, text),
            points=result.points,
        ),
        text("roundness.state", state=state_line(result, text)),
    ]
    if (kind := measured.trace.meta.get("format")) and header.radius_mm is not None:
        lines.append(text("roundness.closed_turn", format=kind, radius=f"{header.radius_mm:.4g}"))
    elif kind:
        lines.append(text("roundness.closed_turn_of_any_size", format=kind))
    if header.filter_upr is not None:
        lines.append(text("roundness.filtered_before", filter=f"{header.filter_upr:g}"))
    if result.recentred:
        lines.append(text("roundness.recentred"))
    if result.left_out:
        lines.append(text("roundness.left_out", count=result.left_out))
    if measured.turns is not None:
        count, random = len(measured.turns.each_um), f"{measured.turns.random_um:.3f}"
        lines.append(text("roundness.turns", count=count, random=random))
    return lines


def filter_line(result: RoundnessResult, text: Catalogue) -> str:
    """Return the filter of a result with its cut-offs."""
    if result.filter_upr is None:
        return text("roundness.no_filter")
    above = "" if result.above_upr is None else f"{result.above_upr:g} - "
    return f"{above}{result.filter_upr:g} UPR"


def state_line(result: RoundnessResult, text: Catalogue) -> str:
    """Return the state of the measured part, translated where it is one of the usual ones."""
    return text(f"state.{result.state}") if result.state in _STATES else result.state


def _size(measured: MeasuredTrace, text: Catalogue) -> list[tuple[str, str, str]]:
    rows = []
    if measured.mean_diameter_mm is not None:
        rows.append((text("roundness.mean_diameter"), f"{measured.mean_diameter_mm:.4f}", "mm"))
    if measured.tool_offset_um is not None:
        rows.append((text("roundness.tool_offset"), f"{measured.tool_offset_um:+z.2f}", "um"))
    return rows


def _harmonics(measured: MeasuredTrace, text: Catalogue) -> list[str]:
    waves = [(text("roundness.n"), text("roundness.amplitude"), text("roundness.crest"))]
    shown = [h for h in measured.result.harmonics if h.n in SHOWN_HARMONICS]
    waves += [(str(h.n), f"{h.amplitude_um:z.3f} um", f"{h.phase_deg:z.2f} deg") for h in shown]
    past = [deg for h in shown if (deg := measured.past_jaw_1_deg(h)) is not None]
    if not past:
        return [*table(waves, numeric=(0, 1, 2)), *_unknown(measured, text)]
    column = [text("roundness.past_jaw_1"), *(f"{deg:z.2f} deg" for deg in past)]
    return table([(*row, cell) for row, cell in zip(waves, column, strict=True)], numeric=(0, 1, 2, 3))


def _unknown(measured: MeasuredTrace, text: Catalogue) -> list[str]:
    """Return which header lines the file needs for angles from jaw 1."""
    header = measured.header
    stated = {"direction": header.direction is not None, "jaw_1_deg": measured.jaw_1_deg is not None}
    if header.phase_known:
        return [text("roundness.from_index")]
    missing = ", ".join(key for key, known in stated.items() if not known)
    return [text("roundness.phase_unknown", missing=missing)]
