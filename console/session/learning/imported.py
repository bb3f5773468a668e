"""A part that a gauge elsewhere has measured: its trace from a file, judged like any other part."""

from __future__ import annotations

import cmath
import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from console.session.cut.run import FILTER_UPR
from console.session.data.measured_part import is_other_lathe
from console.session.errors import SessionError, refuse
from console.session.learning.learning_steps import is_simulated, lathe_of
from profiles.arrays import read_only
from profiles.files import printable
from profiles.job import Job
from profiles.metrology.circles import ReferenceCircle
from profiles.metrology.harmonics import Harmonic
from profiles.metrology.turns import several_turns
from profiles.problem import Problem
from profiles.roundness import RoundnessResult, evaluate
from profiles.trace_files.header import TraceHeader, header_of, unit_doubt
from profiles.traces import Trace, parse_trace, read_trace_file

FREE, CLAMPED = "free", "clamped"
QUESTIONS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"state": (FREE, CLAMPED), "direction": ("cw", "ccw"), "start_mark": ("jaw 1", "spindle index", "unknown")}
)
"""Header keys that an operator is asked for where the file does not state them, with the possible answers."""

UNKNOWN_STATE = "unknown"
_FULL_TURN_DEG = 360.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportedTrace:
    """The trace in a file, for a part of one job; `trace` has the answers among its header lines.

    `asked` are the keys that the file does not state, `open` those of them without an answer yet. `turn` is one
    turn of it: at spindle angles where `phase_known`, else at its own. `problems` are why the part cannot be
    judged by it; `result` is None then, and while the state is open.
    """

    path: Path
    content: bytes = field(repr=False)
    sha256: str
    trace: Trace
    header: TraceHeader
    turn: Trace
    asked: tuple[str, ...]
    open: tuple[str, ...]
    result: RoundnessResult | None  # at the angles of `turn`
    warnings: tuple[Problem, ...] = ()
    problems: tuple[Problem, ...] = ()

    @property
    def phase_known(self) -> bool:
        """Whether the angles are tied to jaw 1 or to the spindle."""
        return self.header.phase_known

    @property
    def ready(self) -> bool:
        """Whether the part can be judged by it."""
        return self.result is not None and not self.open and not self.problems


def examined(
    path: Path, job: Job, answers: Mapping[str, str], *, simulated: bool, lathe: str = ""
) -> ImportedTrace:
    """Read the trace in a file for a part of `job`, cut with jaw 1 where the job has it.

    `answers` are used where the file does not state a key of `QUESTIONS`; `simulated` is whether the part was cut
    in a simulator, `lathe` on which simulated lathe, "" where that is not known.

    Raises ProfileError: the file cannot be read, or its points cannot be evaluated.
    """
    content = read_trace_file(path)
    filed = parse_trace(content, where=printable(str(path)))
    asked = _asked(header_of(filed.meta)[0])
    given = {key: answers[key] for key in asked if key in answers}
    trace = replace(filed, meta=MappingProxyType({**filed.meta, **given}))
    header, warnings = header_of(trace.meta)
    open_ = tuple(key for key in _asked(header) if key not in given)
    problems = _refusals(trace, header, simulated=simulated, lathe=lathe)
    turn = one_turn(trace, header)
    result = None
    if not problems and header.state != UNKNOWN_STATE:
        result = evaluate(
            turn.angle_deg, turn.deviation_um, FILTER_UPR, state=header.state, radius_mm=header.radius_of(job)
        )
        result = result_on_the_spindle(result, header, job.jaw_1_deg)
        problems = unit_doubt(result.ront_um, trace.meta, plane=trace.centre_mm is not None)
    return ImportedTrace(
        path=path,
        content=content,
        sha256=hashlib.sha256(content).hexdigest(),
        trace=trace,
        header=header,
        turn=on_the_spindle(turn, header, job.jaw_1_deg),
        asked=asked,
        open=open_,
        result=None if problems else result,
        warnings=warnings,
        problems=problems,
    )


def refuse_unready(found: ImportedTrace) -> None:
    """Refuse a trace by which the part cannot be judged (its `problems`), or that leaves a question open.

    Raises SessionError: `trace.unanswered`, and the problems of `examined`.
    """
    refuse(found.problems)
    if found.open:
        where = printable(found.path.name)
        raise SessionError(Problem(code="trace.unanswered", where=where, key=", ".join(found.open)))


def _asked(header: TraceHeader) -> tuple[str, ...]:
    """Return the keys that a header leaves open; without a mark, the direction says nothing."""
    marked = header.jaw_1_deg is not None or header.start_mark is not None
    tied = header.jaw_1_deg is not None or header.start_mark != "unknown"
    missing = {
        "state": header.state == UNKNOWN_STATE,
        "direction": tied and header.direction is None,
        "start_mark": not marked,
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


def one_turn(trace: Trace, header: TraceHeader) -> Trace:
    """Return what repeats in each turn of a trace, as one turn; ProfileError `trace.turns`."""
    if header.turns == 1:
        return trace
    turns = several_turns(trace.angle_deg, trace.deviation_um, header.turns)
    meta = MappingProxyType({key: value for key, value in trace.meta.items() if key != "turns"})
    return Trace(angle_deg=turns.angle_deg, deviation_um=turns.repeatable_um, meta=meta)


def on_the_spindle(turn: Trace, header: TraceHeader, spindle_deg: float) -> Trace:
    """Return a turn at spindle angles, rising from 0; as it is where they are not known.

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


def result_on_the_spindle(found: RoundnessResult, header: TraceHeader, spindle_deg: float) -> RoundnessResult:
    """Return the result of a turn with its angles as `on_the_spindle` has them; not a figure of it changes.

    The contacts of the circles, which are places in the order of the file, are left out.
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
