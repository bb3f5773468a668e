"""`console roundness --vblock`: the lobes behind the readings of an indicator over a V-block."""

from __future__ import annotations

from dataclasses import dataclass

from console.cli.roundness_lines import filter_words, state_words
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.metrology.harmonics import Harmonic
from profiles.metrology.v_block import usable_factor
from profiles.problem import Problem, ProfileError
from profiles.roundness import RoundnessResult
from profiles.trace_files.header import TraceHeader


@dataclass(frozen=True, slots=True, kw_only=True)
class VBlockLobe:
    """What was read, and the lobe of the part behind it: its undulation of the readings over the factor."""

    included_deg: float
    factor: float
    reading: RoundnessResult
    lobe: Harmonic


def read_v_block(result: RoundnessResult, included_deg: float, lobes: int) -> VBlockLobe:
    """Return the lobe behind readings that were evaluated like a trace.

    Raises:
        ProfileError: as `usable_factor`; `value.out_of_range`, the points cannot tell so many lobes.
    """
    factor = usable_factor(lobes, included_deg)
    read = next((h for h in result.harmonics if h.n == lobes), None)
    if read is None:
        limit = f"2 - {max((h.n for h in result.harmonics), default=0)}"
        raise ProfileError(Problem(code="value.out_of_range", key="--lobes", value=str(lobes), limit=limit))
    # A factor below 0 reads a valley under the indicator as a crest.
    turned_deg = 180.0 / lobes if factor < 0.0 else 0.0
    lobe = Harmonic(
        n=lobes,
        amplitude_um=read.amplitude_um / abs(factor),
        phase_deg=(read.phase_deg + turned_deg) % (360.0 / lobes),
    )
    return VBlockLobe(included_deg=included_deg, factor=factor, reading=result, lobe=lobe)


def v_block_fields(seen: VBlockLobe, header: TraceHeader) -> dict[str, object]:
    """Return it for JSON; lengths in um, angles in degrees."""
    return {
        "method": "v_block",
        "state": header.state,
        "vblock_deg": seen.included_deg,
        "lobes": seen.lobe.n,
        "factor": seen.factor,
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
        (text("v_block.lobe", n=seen.lobe.n), f"{2.0 * seen.lobe.amplitude_um:z.3f}", "um p-p"),
        (text("roundness.crest"), f"{seen.lobe.phase_deg:z.2f}", "deg"),
    ]
    head = text("v_block.head", angle=f"{seen.included_deg:g}", filter=filter_words(seen.reading, text))
    return [head, text("roundness.state", state=state_words(seen.reading, text)), "", *table(rows, numeric=(1,))]
