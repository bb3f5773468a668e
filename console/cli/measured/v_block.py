"""`console roundness --vblock`: the lobe from indicator readings over a V-block."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from console.cli.measured.roundness_report import filter_line, state_line
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.metrology.filters import gaussian_transmission
from profiles.metrology.v_block import usable_factor
from profiles.problem import Problem, ProfileError
from profiles.roundness import RoundnessResult
from profiles.trace_files.header import TraceHeader


def v_block_fields(
    result: RoundnessResult, included_deg: float, lobes: int, header: TraceHeader
) -> dict[str, Any]:
    """Return the lobe from readings that were evaluated like a trace; lengths in um, angles in degrees.

    It is the undulation of the filtered readings over the factor of the V-block and over the fraction of it that
    the filter let pass.

    Raises:
        ProfileError: as `usable_factor`; `value.out_of_range`, the points cannot resolve so many lobes, or the
            filter takes them for roughness or form.
    """
    factor = usable_factor(lobes, included_deg)
    read = next((h for h in result.harmonics if h.n == lobes), None)
    if read is None:
        limit = f"2 - {max((h.n for h in result.harmonics), default=0)}"
        raise ProfileError(Problem(code="value.out_of_range", key="--lobes", value=str(lobes), limit=limit))
    passed = _passed(result, lobes)
    # With a factor below 0 the indicator reads a valley as a maximum.
    turned_deg = 180.0 / lobes if factor < 0.0 else 0.0
    return {
        "method": "v_block",
        "state": header.state,
        "vblock_deg": included_deg,
        "lobes": lobes,
        "factor": factor,
        "filter_passed": passed,
        "reading_pp_um": result.ront_um,
        "filter_upr": result.filter_upr,
        "above_upr": result.above_upr,
        "lobe_pp_um": 2.0 * (read.amplitude_um / (abs(factor) * passed)),
        "phase_deg": (read.phase_deg + turned_deg) % (360.0 / lobes),
        "phase_known": header.phase_known,
    }


def _passed(result: RoundnessResult, lobes: int) -> float:
    if result.filter_upr is None:
        return 1.0
    above_upr = result.above_upr or 0.0
    if not above_upr <= lobes <= result.filter_upr:
        limit = f"{above_upr:g} - {result.filter_upr:g} UPR"
        raise ProfileError(Problem(code="value.out_of_range", key="--lobes", value=str(lobes), limit=limit))
    below = float(gaussian_transmission(lobes, above_upr)) if above_upr else 0.0
    return float(gaussian_transmission(lobes, result.filter_upr)) - below


def v_block_lines(fields: Mapping[str, Any], result: RoundnessResult, text: Catalogue) -> list[str]:
    """Return the output of `v_block_fields` in words."""
    rows = [
        (text("v_block.reading"), f"{result.ront_um:z.3f}", "um p-p"),
        (text("v_block.factor"), f"{fields['factor']:z.3f}", ""),
        (text("v_block.passed"), f"{100.0 * fields['filter_passed']:z.2f}", "%"),
        (text("v_block.lobe", n=fields["lobes"]), f"{fields['lobe_pp_um']:z.3f}", "um p-p"),
        (text("roundness.phase"), f"{fields['phase_deg']:z.2f}", "deg"),
    ]
    head = text("v_block.head", angle=f"{fields['vblock_deg']:g}", filter=filter_line(result, text))
    return [head, text("roundness.state", state=state_line(result, text)), "", *table(rows, numeric=(1,))]
