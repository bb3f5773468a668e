"""`console roundness`: the roundness of a measured trace."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from console.cli.library import job_of
from console.cli.output import print_json, roundness_fields, tell
from console.cli.roundness_lines import Measured, filter_words, roundness_lines, state_words
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.files import printable
from profiles.job import Job
from profiles.metrology.circles import ReferenceCircle
from profiles.metrology.filters import gaussian_transmission
from profiles.metrology.harmonics import Harmonic
from profiles.metrology.size import mean_diameter_mm, tool_offset_um
from profiles.metrology.turns import Turns, several_turns
from profiles.metrology.v_block import usable_factor
from profiles.problem import Problem, ProfileError
from profiles.roundness import OFF_AXIS, RoundnessResult, evaluate
from profiles.trace_files.header import TraceHeader, header_of
from profiles.traces import Trace, read_trace


@dataclass(frozen=True, slots=True, kw_only=True)
class VBlockLobe:
    """What was read, and the lobe of the part behind it.

    It is the undulation of the filtered readings over the factor of the V-block and over `passed`, the share of it
    that the filter let pass.
    """

    included_deg: float
    factor: float
    passed: float
    reading: RoundnessResult
    lobe: Harmonic


def read_v_block(result: RoundnessResult, included_deg: float, lobes: int) -> VBlockLobe:
    """Return the lobe behind readings that were evaluated like a trace.

    Raises:
        ProfileError: as `usable_factor`; `value.out_of_range`, the points cannot tell so many lobes, or the filter
            takes them for roughness or form.
    """
    factor = usable_factor(lobes, included_deg)
    read = next((h for h in result.harmonics if h.n == lobes), None)
    if read is None:
        limit = f"2 - {max((h.n for h in result.harmonics), default=0)}"
        raise ProfileError(Problem(code="value.out_of_range", key="--lobes", value=str(lobes), limit=limit))
    passed = _passed(result, lobes)
    # A factor below 0 reads a valley under the indicator as a crest.
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
        (text("roundness.crest"), f"{seen.lobe.phase_deg:z.2f}", "deg"),
    ]
    head = text("v_block.head", angle=f"{seen.included_deg:g}", filter=filter_words(seen.reading, text))
    return [head, text("roundness.state", state=state_words(seen.reading, text)), "", *table(rows, numeric=(1,))]


def main(options: Namespace, text: Catalogue) -> int:
    """Evaluate a trace and print its roundness; warnings go to stderr."""
    measured = _measured(options)
    warnings = tell(measured.result.warnings, text)
    if options.vblock is not None:
        with _naming(printable(options.file)):
            lobe = read_v_block(measured.result, options.vblock, options.lobes)
        fields, lines = v_block_fields(lobe, measured.header), v_block_lines(lobe, text)
    else:
        shown = _of_circle(measured.result, options.circle)
        measured = replace(measured, result=shown)
        fields, lines = _fields(measured), roundness_lines(measured, text)
    if options.json:
        print_json({"file": options.file, **fields, "meta": dict(measured.trace.meta), "warnings": warnings})
        return 0
    print("\n".join(lines))
    return 0


def _measured(options: Namespace) -> Measured:
    """Return what came of the trace with every warning; every problem of it names the file."""
    where = printable(options.file)
    job = job_of(options).job if options.job else None
    trace = read_trace(Path(options.file))
    header, warnings = header_of(trace.meta)
    _refuse_method(header, options, where)
    with _naming(where):
        turns, result = _evaluated(trace, header, job, options)
    warnings = (*warnings, *(each for each in result.warnings if each.code != OFF_AXIS or options.vblock is None))
    size_mm = offset_um = None
    if header.radius_mm is not None and header.size != "relative":
        size_mm = mean_diameter_mm(header.radius_mm, result.mean_deviation_um)
    if job is not None and size_mm is not None:
        offset_um = tool_offset_um(size_mm, job.diameter_mm - 2.0 * job.depth_of_cut_mm)
    elif job is not None:
        warnings = (*warnings, Problem(code="trace.no_size", key="radius_mm", limit="# radius_mm: R"))
    return Measured(
        trace=trace,
        header=header,
        result=replace(result, warnings=tuple(replace(problem, where=where) for problem in warnings)),
        turns=turns,
        jaw_1_deg=header.jaw_1_of(None if job is None else job.jaw_1_deg),
        mean_diameter_mm=size_mm,
        tool_offset_um=offset_um,
    )


@contextmanager
def _naming(where: str) -> Iterator[None]:
    """Have every problem name the file."""
    try:
        yield
    except ProfileError as error:
        raise ProfileError(*(replace(problem, where=where) for problem in error.problems)) from error


def _evaluated(
    trace: Trace, header: TraceHeader, job: Job | None, options: Namespace
) -> tuple[Turns | None, RoundnessResult]:
    above_upr, filter_upr = options.band or (None, options.filter)
    angle_deg, deviation_um, turns = trace.angle_deg, trace.deviation_um, None
    if header.turns > 1:
        turns = several_turns(angle_deg, deviation_um, header.turns)
        angle_deg, deviation_um = turns.angle_deg, turns.repeatable_um
    radius_mm = header.radius_mm if job is None else header.radius_of(job)
    result = evaluate(
        angle_deg,
        deviation_um,
        filter_upr,
        state=header.state,
        radius_mm=radius_mm if options.vblock is None else None,
        above_upr=above_upr,
        robust=options.robust,
    )
    return turns, result


def _refuse_method(header: TraceHeader, options: Namespace, where: str) -> None:
    if header.method == "two_point":
        raise ProfileError(Problem(code="trace.two_point", where=where, key="method", value="two_point"))
    asked = header.method == "v_block" or options.vblock is not None or options.lobes is not None
    if asked and (options.vblock is None or options.lobes is None):
        raise ProfileError(Problem(code="trace.v_block", where=where, limit="--vblock DEG --lobes N"))


def _of_circle(result: RoundnessResult, kind: str) -> RoundnessResult:
    """Return the result with the figures of another reference circle."""
    circle = result.circle(kind)
    if kind == result.reference_circle:
        return result
    return replace(
        result,
        reference_circle=kind,
        ront_um=circle.ront_um,
        ronp_um=circle.ronp_um,
        ronv_um=circle.ronv_um,
        ronq_um=circle.ronq_um,
        centre_x_um=circle.centre_x_um,
        centre_y_um=circle.centre_y_um,
    )


def _fields(measured: Measured) -> dict[str, object]:
    result, header = measured.result, measured.header
    return {
        **roundness_fields(result),
        "harmonics": [_harmonic(h, measured) for h in result.harmonics],
        "circles": [_circle(circle) for circle in result.circles],
        "above_upr": result.above_upr,
        "filter_applied_upr": header.filter_upr,
        "recentred": result.recentred,
        "left_out": result.left_out,
        "phase_known": header.phase_known,
        "jaw_1_deg": measured.jaw_1_deg,
        "mean_diameter_mm": measured.mean_diameter_mm,
        "tool_offset_um": measured.tool_offset_um,
        "turns": None if measured.turns is None else _turns(measured.turns, result),
    }


def _harmonic(wave: Harmonic, measured: Measured) -> dict[str, object]:
    fields = {"n": wave.n, "amplitude_um": wave.amplitude_um, "phase_deg": wave.phase_deg}
    return {**fields, "past_jaw_1_deg": measured.past_jaw_1_deg(wave)}


def _circle(circle: ReferenceCircle) -> dict[str, object]:
    return {
        "circle": circle.kind,
        "RONt_um": circle.ront_um,
        "RONp_um": circle.ronp_um,
        "RONv_um": circle.ronv_um,
        "RONq_um": circle.ronq_um,
        "centre_x_um": circle.centre_x_um,
        "centre_y_um": circle.centre_y_um,
        "deviation_um": circle.deviation_um,
        "contacts": [{"angle_deg": contact.angle_deg, "outer": contact.outer} for contact in circle.contacts],
    }


def _turns(turns: Turns, result: RoundnessResult) -> dict[str, object]:
    spread = [{"n": h.n, "sd_um": turns.amplitude_sd_um(h.n)} for h in result.harmonics]
    return {"count": len(turns.each_um), "random_um": turns.random_um, "amplitudes": spread}
