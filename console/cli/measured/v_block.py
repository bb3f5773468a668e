"""`console roundness --vblock`: the lobe from indicator readings over a V-block."""

from __future__ import annotations

from dataclasses import dataclass

from console.cli.measured.roundness_report import filter_line, state_line
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.metrology.harmonics import Harmonic, usable_factor
from profiles.metrology.points import gaussian_transmission
from profiles.problem import Problem, ProfileError
from profiles.roundness import RoundnessResult
from profiles.trace_files.header import TraceHeader


@dataclass(frozen=True, slots=True, kw_only=True)
class VBlockLobe:
    """The readings, and the lobe of the part derived from them.

    It is the undulation of the filtered readings over the factor of the V-block and over `passed`, the fraction of
    it that the filter let pass.
    """

    included_deg: float
    factor: float
    passed: float
    reading: RoundnessResult
    lobe: Harmonic


def read_v_block(result: RoundnessResult, included_deg: float, lobes: int) -> VBlockLobe:
    """Return the lobe from readings that were evaluated like a trace.

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
    lobe = Harmonic(
        n=lobes,
        amplitude_um=read.amplitude_um / (abs(factor) * passed),
        phase_deg=(read.phase_deg + turned_deg) % (360.0 / lobes),
    )
    return VBlockLobe(included_deg=included_deg, factor=factor, passed=passed, reading=result, lobe=lobe)


def _passed(result: RoundnessResult, lobes: int) -> float:
    if result.filter_upr is None:
        return 1.0
    above_upr = result.above_upr or 0.0
    if not above_upr <= lobes <= result.filter_upr:
        limit = f"{above_upr:g} - {result.filter_upr:g} UPR"
        raise ProfileError(Problem(code="value.out_of_range", key="--lobes", value=str(lobes), limit=limit))
    below = float(gaussian_transmission(lobes, above_upr)) if above_upr else 0.0
    return float(gaussian_transmission(lobes, result.filter_upr)) - below


def v_block_fields(seen: VBlockLobe, header: TraceHeader) -> dict[str, object]:
    """Return it for JSON; lengths in um, angles in degrees."""
    return {
        "method": "v_block",
        "state": header.state,
        "vblock_deg": seen.included_deg,
        "lobes": seen.lobe.n,
        "factor": seen.factor,
        "filter_passed": seen.passed,
        "reading_pp_um": seen.reading.ront_um,
        "filter_upr": seen.reading.filter_upr,
        "above_upr": seen.reading.above_upr,
        "lobe_pp_um": 2.0 * seen.lobe.amplitude_um,
        "phase_deg": seen.lobe.phase_deg,
        "phase_known": header.phase_known,
    }


def v_block_lines(seen: VBlockLobe, text: Catalogue) -> list[str]:
    """Return it for people."""
    rows = [
        (text("v_block.reading"), f"{seen.reading.ront_um:z.3f}", "um p-p"),
        (text("v_block.factor"), f"{seen.factor:z.3f}", ""),
        (text("v_block.passed"), f"{100.0 * seen.passed:z.2f}", "%"),
        (text("v_block.lobe", n=seen.lobe.n), f"{2.0 * seen.lobe.amplitude_um:z.3f}", "um p-p"),
        (text("roundness.phase"), f"{seen.lobe.phase_deg:z.2f}", "deg"),
    ]
    head = text("v_block.head", angle=f"{seen.included_deg:g}", filter=filter_line(seen.reading, text))
    return [head, text("roundness.state", state=state_line(seen.reading, text)), "", *table(rows, numeric=(1,))]
