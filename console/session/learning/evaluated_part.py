"""A part evaluated from its trace, which is in the record, as it was judged then, or in the file of a gauge."""

from __future__ import annotations

import cmath
import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from console.session.cut.recording import mean_diameter_of
from console.session.cut.run import FILTER_UPR, measured_whole
from console.session.data.measured_part import RecordedPart, is_other_lathe
from console.session.errors import SessionError, refuse
from console.session.learning.gauge_errors import filed_without_error
from console.session.learning.learning_steps import is_simulated, lathe_of
from profiles.arrays import Floats, read_only
from profiles.files import printable
from profiles.job import Job
from profiles.lobe.cut_error import middle_mm
from profiles.metrology.circles import ReferenceCircle
from profiles.metrology.cylindricity import (
    LEAST_SECTIONS,
    LEAST_SPAN,
    CylinderResult,
    coarse_points,
    evaluate_points,
    few_sections,
    part_section,
)
from profiles.metrology.harmonics import Harmonic
from profiles.metrology.separation import GaugeError
from profiles.metrology.turns import Turns, several_turns, tool_offset_um
from profiles.problem import Problem, ProfileError
from profiles.roundness import RoundnessResult, centred_profile, evaluate
from profiles.strict_values import number_or_none
from profiles.trace_files.header import Z_FROM, TraceHeader, header_of, size_doubt, unit_doubt
from profiles.trace_files.sections import (
    HEIGHT,
    SurfacePoints,
    TraceSection,
    no_sections,
    parse_surface,
    read_sections,
    sections_content,
)
from profiles.traces import Trace, read_trace_file

FREE, CLAMPED = "free", "clamped"
QUESTIONS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "state": (FREE, CLAMPED),
        "direction": ("cw", "ccw"),
        "start_mark": ("jaw 1", "spindle index", "unknown"),
        "z_from": Z_FROM,
    }
)
"""Header keys that an operator is asked for where the file does not state them, with the possible answers."""

OF_FORM = ("state", "z_from")
"""Those that matter for points that are no sections: nothing of them is placed on the spindle."""

UNKNOWN_STATE = "unknown"
_FULL_TURN_DEG = 360.0
SAME_UM, SAME_MM = 1e-6, 1e-9
"""Difference within which two evaluations are the same: far above the last bit, far below the last digit shown."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EvaluatedPart:
    """A part with its trace and one `turn` of it; numerics run when their result is first read.

    `jaw_1_deg` is jaw 1 in the angles of `turn`, None if unknown; `warnings` are those of the header. `judged` is
    the result by which it is judged, None if it is not, for `problems` or before the state is known. `result` and
    `profile_um` raise ProfileError if the trace cannot be evaluated.

    The trace of a file, at `path` with this `content`, has the operator's answers among its header lines; that of
    several, `others` beside the first, has the content of one file with all of their sections. `asked` are the
    keys that it does not state, `open` those of them without an answer yet.

    `sections` are all measured ones from the lowest Z up, in the job's Z (mm from the jaw faces), each as one turn
    at the angles of `turn`; `trace` and `turn` are those at `section_z_mm`, the nearest to the middle of the cut.
    With one section only it may be None: not stated. `whole` is the form over the length, None where sections are
    too few for it. `place` counts the sections of the content that are below in its own heights.
    """

    trace: Trace
    header: TraceHeader
    turn: Trace
    turns: Turns | None = None
    jaw_1_deg: float | None = None
    job: Job | None = None
    filter_upr: float = FILTER_UPR
    radius_mm: float | None = None
    judged: RoundnessResult | None = None
    warnings: tuple[Problem, ...] = ()
    problems: tuple[Problem, ...] = ()
    recorded: RecordedPart | None = None
    path: Path = Path()
    others: tuple[Path, ...] = ()
    content: bytes = field(default=b"", repr=False)
    asked: tuple[str, ...] = ()
    open: tuple[str, ...] = ()
    sections: tuple[TraceSection, ...] = ()
    whole: CylinderResult | None = None
    section_z_mm: float | None = None
    place: int = 0

    @cached_property
    def result(self) -> RoundnessResult:
        """The roundness at the angles of the turn."""
        turn, state = self.turn, self.header.state
        return self.judged or evaluate(
            turn.angle_deg, turn.deviation_um, self.filter_upr, state=state, radius_mm=self.radius_mm
        )

    @cached_property
    def profile_um(self) -> Floats:
        """The deviations from the least squares circle at the angles of the turn."""
        return centred_profile(self.turn.angle_deg, self.turn.deviation_um, self.filter_upr)

    @cached_property
    def sha256(self) -> str:
        """The hash of the file."""
        return hashlib.sha256(self.content).hexdigest()

    @property
    def name(self) -> str:
        """The name of the file, and how many more there are."""
        more = f" + {len(self.others)}" if self.others else ""
        return printable(self.path.name) + more

    @property
    def ready(self) -> bool:
        """Whether the part can be judged by the trace."""
        return (self.judged is not None or self.is_points) and not self.open and not self.problems

    @property
    def is_points(self) -> bool:
        """Whether it was measured in points that are no sections: its form is judged, and no roundness."""
        return self.whole is not None and not self.whole.sections

    @property
    def mean_diameter_mm(self) -> float | None:
        """The mean diameter; None if the trace has no size."""
        return mean_diameter_of(self.trace, self.result)

    @property
    def tool_offset_um(self) -> float | None:
        """How much deeper the tool has to go for the diameter of the job; None without a size that may be its."""
        diameter_mm, job = self.mean_diameter_mm, self.job
        if diameter_mm is None or job is None or size_doubt(diameter_mm / 2.0, job) is not None:
            return None
        return tool_offset_um(diameter_mm, job.finished_diameter_mm)

    def past_jaw_1_deg(self, harmonic: Harmonic) -> float | None:
        """Return the phase of an undulation (its first maximum) from jaw 1, None if that is unknown."""
        if self.jaw_1_deg is None:
            return None
        return harmonic.past_jaw_1_deg(self.jaw_1_deg, against_spindle=self.header.against_spindle)

    @property
    def differing(self) -> tuple[str, ...]:
        """The names of the recorded figures that the trace does not give."""
        part, found = self.recorded, self.result
        if part is None:
            return ()
        pairs = [
            (name, number_or_none(part.data.get(f"{name}_um")), getattr(found, f"{name.lower()}_um"), SAME_UM)
            for name in ("RONp", "RONv", "RONq")
        ]
        pairs = [("RONt", part.ront_um, found.ront_um, SAME_UM), *pairs]
        pairs.append(("D", part.diameter_mm, self.mean_diameter_mm, SAME_MM))
        return tuple(
            name
            for name, one, other, allowed in pairs
            if one is not None and other is not None and not abs(one - other) <= allowed
        )


def evaluate_part(
    part: RecordedPart, setup: Mapping[str, Any], *at_once: str, on_spindle: bool = False
) -> EvaluatedPart | None:
    """Read the trace of a part of a run with this set-up, None without one; `on_spindle`: at spindle angles.

    `at_once` are the properties that are computed here and not when they are first read.
    Raises ProfileError: the trace cannot be read, or not evaluated.
    """
    trace = part.read_trace()
    if trace is None:
        return None
    header, warnings = header_of(trace.meta)
    turn, _ = fold_turns(trace, header)
    spindle_deg = number_or_none(part.data.get("jaw_1_deg", setup.get("jaw_1_deg")))
    jaw_1_deg = header.jaw_1_of(spindle_deg)
    if on_spindle:
        jaw_1_deg = spindle_deg if header.phase_known else None
        turn = turn if jaw_1_deg is None else turn_to_spindle(turn, header, jaw_1_deg)
    found = EvaluatedPart(
        recorded=part,
        trace=trace,
        header=header,
        turn=turn,
        jaw_1_deg=jaw_1_deg,
        filter_upr=number_or_none(part.data.get("filter_upr")) or FILTER_UPR,
        radius_mm=number_or_none(part.data.get("radius_mm")),
        warnings=warnings,
    )
    for name in at_once:
        getattr(found, name)
    return found


def read_gauge_file(
    path: Path,
    job: Job,
    answers: Mapping[str, str],
    *,
    simulated: bool,
    lathe: str = "",
    others: tuple[Path, ...] = (),
    error: GaugeError | None = None,
) -> EvaluatedPart:
    """Read the sections in a file, or in several, for a part of `job`, cut with jaw 1 where the job has it.

    `answers` replace the keys of `QUESTIONS` that the file does not state; `simulated`: the part was cut in a
    simulator, `lathe` names the simulated lathe, "" if unknown. It is judged by the section nearest to the middle
    of the cut. Of points that are no sections only `whole` is known; a warning says so. The `error` of its gauge
    is taken off, and a warning says so.

    Raises ProfileError: the file cannot be read, or its points cannot be evaluated.
    """
    content, filed = _read_files(path, others)
    filed, off = filed_without_error(filed, error)
    if isinstance(filed, SurfacePoints):
        found = _points_of_file(path, content, filed, job, answers, simulated=simulated, lathe=lathe)
        return replace(found, warnings=(*off, *found.warnings))
    heights = filed[0].z_mm is not None
    asked = _list_questions(header_of(filed[0].trace.meta)[0], heights=heights)
    given = {key: answers[key] for key in asked if key in answers}
    traces = [replace(each.trace, meta=MappingProxyType({**each.trace.meta, **given})) for each in filed]
    header, warnings = header_of(traces[0].meta)
    heights_mm, outside = place_heights([each.z_mm for each in filed], header, job)
    place = _middle_of(heights_mm, job)
    folded = [fold_turns(each, header) for each in traces]
    turned = [turn_to_spindle(turn, header, job.jaw_1_deg) for turn, _ in folded]
    on_part = [TraceSection(z_mm=z_mm, trace=turn) for z_mm, turn in zip(heights_mm, turned, strict=True)]
    found = EvaluatedPart(
        path=path,
        others=others,
        content=content,
        trace=traces[place],
        header=header,
        turn=turned[place],
        turns=folded[place][1],
        job=job,
        asked=asked,
        open=tuple(key for key in _list_questions(header, heights=heights) if key not in given),
        warnings=(*off, *warnings),
        problems=(*_refusals(traces[place], header, simulated=simulated, lathe=lathe), *outside),
        sections=tuple(sorted(on_part, key=lambda each: each.z_mm or 0.0)),
        section_z_mm=heights_mm[place],
        place=place,
    )
    if found.problems or header.state == UNKNOWN_STATE or "z_from" in found.open:
        return found
    return _judge(found, [(z_mm, turn) for z_mm, (turn, _) in zip(heights_mm, folded, strict=True)], job)


def _read_files(path: Path, others: tuple[Path, ...]) -> tuple[bytes, tuple[TraceSection, ...] | SurfacePoints]:
    if others:
        sections = read_sections((path, *others))
        return sections_content(sections), sections
    content = read_trace_file(path)
    return content, parse_surface(content, where=printable(str(path)))


@dataclass(frozen=True, kw_only=True, eq=False)
class FiledSections:
    """The sections of a file at the angles of the file, in the job's Z; `trace` is the one at `section_z_mm`.

    `whole` is their form over the length, None where they do not tell it; `doubts` are what is doubtful in the
    other sections, and that an error of the gauge was taken off.
    """

    content: bytes = field(repr=False)
    sections: tuple[TraceSection, ...]
    trace: Trace
    section_z_mm: float | None
    whole: CylinderResult | None
    doubts: tuple[Problem, ...]


def read_section_file(path: Path, job: Job, error: GaugeError | None = None) -> FiledSections:
    """Read the sections in a file for a part of `job`, with what its header states and nothing besides.

    Raises ProfileError: as `parse_sections`; `trace.unanswered`, several that do not state `# z_from`;
    `trace.off_cut`.
    """
    where = printable(str(path))
    content, filed = _read_files(path, ())
    filed, off = filed_without_error(filed, error)
    if isinstance(filed, SurfacePoints):
        raise ProfileError(no_sections(filed, where))
    header, _ = header_of(filed[0].trace.meta)
    heights_mm, outside = place_heights([each.z_mm for each in filed], header, job)
    if outside:
        raise ProfileError(*outside)
    if len(filed) > 1 and header.z_from is None:
        raise ProfileError(Problem(code="trace.unanswered", where=where, key=f"# z_from: {' | '.join(Z_FROM)}"))
    heights_mm = heights_mm if header.z_from is not None else [None]
    place = _middle_of(heights_mm, job)
    sections = [TraceSection(z_mm=z, trace=each.trace) for z, each in zip(heights_mm, filed, strict=True)]
    turns = [(each.z_mm, fold_turns(each.trace, header)[0]) for each in sections]
    return FiledSections(
        content=content,
        sections=tuple(sorted(sections, key=lambda each: each.z_mm or 0.0)),
        trace=filed[place].trace,
        section_z_mm=heights_mm[place],
        whole=whole_of([TraceSection(z_mm=z, trace=turn) for z, turn in turns], job),
        doubts=(*off, *_results_of(turns, place, header, job)[1]),
    )


def _middle_of(heights_mm: Sequence[float | None], job: Job) -> int:
    """Return which section is the nearest to the middle of the cut."""
    return min(range(len(heights_mm)), key=lambda at: abs((heights_mm[at] or 0.0) - middle_mm(job)))


def whole_of(sections: Sequence[TraceSection], job: Job) -> CylinderResult | None:
    """Return the form over the length by sections of one turn; None where they are of too little of it."""
    if _too_short(_span_mm(sections), job):
        return None
    return measured_whole([part_section(each) for each in sections if each.z_mm is not None])


def _span_mm(sections: Sequence[TraceSection]) -> float:
    return float(np.ptp([each.z_mm for each in sections if each.z_mm is not None] or [0.0]))


def _judge(found: EvaluatedPart, turns: Sequence[tuple[float | None, Trace]], job: Job) -> EvaluatedPart:
    """Return a part with its result and its form; `turns` are its sections at the angles of the file."""
    header, whole = found.header, whole_of(found.sections, job)
    results, warnings = _results_of(turns, found.place, header, job)
    result = turn_result_to_spindle(results[found.place], header, job.jaw_1_deg)
    trace = found.trace
    problems = unit_doubt(result.ront_um, trace.meta, plane=trace.centre_mm is not None)
    return replace(
        found,
        judged=None if problems else result,
        whole=whole,
        warnings=(*found.warnings, *warnings),
        problems=problems,
    )


def _results_of(
    turns: Sequence[tuple[float | None, Trace]], place: int, header: TraceHeader, job: Job
) -> tuple[list[RoundnessResult], tuple[Problem, ...]]:
    """Return the roundness of each section, and what is doubtful in those besides the one at `place`."""
    results = list[RoundnessResult]()
    for z_mm, turn in turns:
        with at_height(z_mm if len(turns) > 1 else None):
            radius_mm = header.radius_of(job)
            results.append(
                evaluate(turn.angle_deg, turn.deviation_um, FILTER_UPR, state=header.state, radius_mm=radius_mm)
            )
    others = [(z, each) for (z, _), each in zip(turns, results, strict=True) if each is not results[place]]
    warnings = tuple(replace(each, where=f"Z {z:g} mm") for z, result in others for each in result.warnings)
    heights = [z for z, _ in turns if z is not None]
    if others and len(heights) < LEAST_SECTIONS:
        warnings += (few_sections(len(turns)),)
    elif others:
        warnings += _too_short(float(np.ptp(heights)), job)
    return results, warnings


@contextmanager
def at_height(z_mm: float | None) -> Iterator[None]:
    """Name the height of a section in the problems of its evaluation; None: it is the only one."""
    try:
        yield
    except ProfileError as error:
        where = "" if z_mm is None else f"Z {z_mm:g} mm"
        raise ProfileError(*(replace(each, where=each.where or where) for each in error.problems)) from error


def _points_of_file(
    path: Path,
    content: bytes,
    filed: SurfacePoints,
    job: Job,
    answers: Mapping[str, str],
    *,
    simulated: bool,
    lathe: str,
) -> EvaluatedPart:
    """Return points that are no sections: their form over the length is judged, and no roundness."""
    listed = _list_questions(header_of(filed.meta)[0], heights=True)
    asked = tuple(key for key in listed if key in OF_FORM)
    given = {key: answers[key] for key in asked if key in answers}
    meta = MappingProxyType({**filed.meta, **given})
    cloud = Trace(angle_deg=filed.angle_deg, deviation_um=filed.deviation_um, meta=meta)
    (header, warnings), whole = header_of(meta), evaluate_points(filed)
    _, outside = place_heights([float(filed.z_mm.min()), float(filed.z_mm.max())], header, job)
    return EvaluatedPart(
        path=path,
        content=content,
        trace=cloud,
        header=header,
        turn=cloud,
        job=job,
        asked=asked,
        open=tuple(key for key in asked if key not in given),
        whole=whole,
        warnings=(*warnings, no_sections(filed, "")),
        problems=(
            *_refusals(cloud, header, simulated=simulated, lathe=lathe),
            *outside,
            *_too_short(float(np.ptp(filed.z_mm)), job),
            *coarse_points(filed, job.jaws),
            *unit_doubt(whole.cylt_um, meta, plane="radius_mm" in meta),
        ),
    )


def _too_short(span_mm: float, job: Job) -> tuple[Problem, ...]:
    """Return why heights so far apart do not show the form over the cut; nothing where they do."""
    least_mm = LEAST_SPAN * job.cut_length_mm
    if span_mm >= least_mm:
        return ()
    value, limit = f"{span_mm:.3g} mm", f">= {least_mm:.3g} mm"
    return (Problem(code="trace.short_length", key=HEIGHT, value=value, limit=limit),)


def place_heights(
    filed_mm: Sequence[float | None], header: TraceHeader, job: Job
) -> tuple[Sequence[float | None], tuple[Problem, ...]]:
    """Return the heights of a file in the job's Z, and a problem for each that is not on its cut.

    From the free end they are counted into the part, with either sign. Without an answer they stay as filed.
    """
    known = [each for each in filed_mm if each is not None]
    if header.z_from is None or not known:
        return filed_mm, ()
    into = -1.0 if max(known) <= 0.0 else 1.0
    found = [job.overhang_mm - into * each if header.z_from == Z_FROM[1] else each for each in known]
    first_mm, last_mm = job.overhang_mm - job.cut_length_mm, job.overhang_mm
    problems = tuple(
        Problem(
            code="trace.off_cut",
            key=f"{HEIGHT} {own:g} ({header.z_from})",
            value=f"{z_mm:g} mm",
            limit=f"{first_mm:g} … {last_mm:g} mm",
        )
        for own, z_mm in zip(known, found, strict=True)
        if not first_mm - SAME_MM <= z_mm <= last_mm + SAME_MM
    )
    return found, problems[:1]


def refuse_unready(found: EvaluatedPart) -> None:
    """Refuse a trace by which the part cannot be judged (its `problems`), or that leaves a question open.

    Raises SessionError: `trace.unanswered`, and the problems of `read_gauge_file`.
    """
    refuse(found.problems)
    if found.open:
        raise SessionError(Problem(code="trace.unanswered", where=found.name, key=", ".join(found.open)))


def _list_questions(header: TraceHeader, *, heights: bool) -> tuple[str, ...]:
    """Return the keys that a header leaves open; without a mark, the direction says nothing."""
    marked = header.jaw_1_deg is not None or header.start_mark is not None
    tied = header.jaw_1_deg is not None or header.start_mark != "unknown"
    missing = {
        "state": header.state == UNKNOWN_STATE,
        "direction": tied and header.direction is None,
        "start_mark": not marked,
        "z_from": heights and header.z_from is None,
    }
    return tuple(key for key in QUESTIONS if missing[key])


def _refusals(trace: Trace, header: TraceHeader, *, simulated: bool, lathe: str) -> tuple[Problem, ...]:
    """Return why a part must not be judged by this trace."""
    problems = []
    if is_simulated(trace) is not simulated:
        problems.append(Problem(code="trace.simulated_part" if not simulated else "trace.real_part"))
    elif is_other_lathe(lathe_of(trace), lathe):
        problems.append(Problem(code="trace.other_lathe", value=printable(lathe_of(trace), 60), limit=lathe))
    if header.method == "two_point":
        problems.append(Problem(code="trace.two_point", key="method", value="two_point"))
    elif header.method == "v_block":
        problems.append(Problem(code="trace.v_block_part"))
    if header.state not in (FREE, UNKNOWN_STATE):
        problems.append(Problem(code="trace.not_released", key="state", value=printable(header.state, 60)))
    return tuple(problems)


def fold_turns(trace: Trace, header: TraceHeader) -> tuple[Trace, Turns | None]:
    """Return the repeatable deviation of the turns of a trace as one turn, and all; ProfileError `trace.turns`."""
    if header.turns == 1:
        return trace, None
    turns = several_turns(trace.angle_deg, trace.deviation_um, header.turns)
    meta = MappingProxyType({key: value for key, value in trace.meta.items() if key != "turns"})
    return Trace(angle_deg=turns.angle_deg, deviation_um=turns.repeatable_um, meta=meta), turns


def turn_to_spindle(turn: Trace, header: TraceHeader, spindle_deg: float) -> Trace:
    """Return a turn at spindle angles, rising from 0; unchanged if they are unknown.

    `spindle_deg` is the spindle angle of jaw 1 in the cut.
    """
    jaw_1_deg = header.jaw_1_of(spindle_deg)
    if jaw_1_deg is None:
        return turn
    way = -1.0 if header.against_spindle else 1.0
    angle_deg = np.mod(spindle_deg + way * (turn.angle_deg - jaw_1_deg), _FULL_TURN_DEG)
    order = np.argsort(angle_deg, kind="stable")
    meta = {key: value for key, value in turn.meta.items() if key != "jaw_1_deg"}
    return Trace(
        angle_deg=read_only(angle_deg[order]),
        deviation_um=read_only(turn.deviation_um[order]),
        meta=MappingProxyType({**meta, "direction": "spindle", "start_mark": "spindle index"}),
    )


def turn_result_to_spindle(found: RoundnessResult, header: TraceHeader, spindle_deg: float) -> RoundnessResult:
    """Return the result of a turn at spindle angles; no figure changes.

    The contacts of the circles are left out: they are indices into the points of the file.
    """
    jaw_1_deg = header.jaw_1_of(spindle_deg)
    if jaw_1_deg is None:
        return found
    way = -1.0 if header.against_spindle else 1.0
    turned = cmath.exp(1j * math.radians(spindle_deg - way * jaw_1_deg))

    def centre(x_um: float, y_um: float) -> complex:
        return turned * complex(x_um, way * y_um)

    def placed(each: Harmonic) -> Harmonic:
        past_deg = each.past_jaw_1_deg(jaw_1_deg, against_spindle=header.against_spindle)
        phase_deg = replace(each, phase_deg=past_deg).past_jaw_1_deg(-spindle_deg)
        return replace(each, phase_deg=phase_deg)

    def about(circle: ReferenceCircle) -> ReferenceCircle:
        own = centre(circle.centre_x_um, circle.centre_y_um)
        return replace(circle, centre_x_um=own.real, centre_y_um=own.imag, contacts=())

    own = centre(found.centre_x_um, found.centre_y_um)
    return replace(
        found,
        centre_x_um=own.real,
        centre_y_um=own.imag,
        harmonics=tuple(placed(each) for each in found.harmonics),
        circles=tuple(about(each) for each in found.circles),
    )
