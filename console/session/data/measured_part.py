"""A measured part: the cut it is from (how it was made), and its figures and trace as the record keeps them.

How a part was cut is known by arguments, by its trace, and by the run record.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from console.session.data.history import form_of
from console.session.data.kept_files import ahead_problems
from console.session.data.learned_store import NONE
from console.session.data.run_rows import NOT_PROVEN
from console.session.errors import SessionError
from console.session.force_record import force_of
from drivers.simulator.plant.which_lathe import LATHE, WHICH
from profiles.files import printable
from profiles.metrology.conformity import (
    DecisionRule,
    FigureUncertainty,
    JudgedFigure,
    SectionForm,
    ToleranceKind,
    Tolerances,
    figure_of,
    judge_part,
    passes_all,
)
from profiles.metrology.length_causes import CAUSES, LengthCause, LengthCauseKind
from profiles.metrology.separation import GaugeError
from profiles.problem import Problem, refusal_error
from profiles.strict_values import from_json, number, number_or_none, record, text, whole_number
from profiles.trace_files.gauge_error import take_error_off
from profiles.trace_files.header import GAUGE_ERROR
from profiles.trace_files.sections import parse_sections
from profiles.traces import Trace

if TYPE_CHECKING:
    from profiles.compensations.force_null import ForceNull
    from profiles.compensations.learned_compensation import HoldsFor
    from profiles.roundness import RoundnessResult

LOCK_TIMEOUT_S = 1.0
AIR, FULL = "air", "full"  # of `Stage`, which takes the planner of cuts with it
MOST_NAMED = 3  # simulated lathes in a message

_WHICH = f"json_extract(runs.setup, '$.{LATHE}.{WHICH}')"
_QUERY = f"""
SELECT events.kind, events.data, events.at_utc, {_WHICH} FROM events JOIN runs USING (run_id)
WHERE events.kind IN ('result', 'cut') AND runs.simulated = ? AND runs.job_sha256 = ? AND runs.machine_sha256 = ?
ORDER BY events.rowid DESC
"""
"""By row, the order in which they were added: a clock may have been set back meanwhile."""

_NEWEST = f"""
SELECT events.kind, events.data, events.at_utc, {_WHICH}, events.run_id, EXISTS (
    SELECT 1 FROM events AS later JOIN runs AS other ON other.run_id = later.run_id
    WHERE later.kind = 'started' AND later.rowid > events.rowid
    AND other.machine = runs.machine AND other.simulated = runs.simulated
)
FROM events JOIN runs USING (run_id)
WHERE events.kind IN ('result', 'cut') AND runs.simulated = ? AND runs.job_sha256 = ? AND runs.machine_sha256 = ?
ORDER BY events.rowid DESC LIMIT 20
"""


Cut = tuple[str, str, str]
"""Kind, data and date of a cut, as in the run record."""

INVERTED, MODEL = "inverted", "model"

TOOL_LOBE, PUSH = "tool_lobe_um", "push_um"
CHANGED = "changed"
CUT_JAW, AS_FILED = "cut_jaw_1_deg", "file"
FINGERPRINT = "fingerprint"
SECTION, SECTION_Z = "section", "section_z_mm"
"""Which section of its file a part was judged by, from the lowest up, and the Z of it, None if not stated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MadeWith:
    """How a part was cut: the version of the compensation ("none": nothing learned), the strategy, the stage.

    `inverted` names the response that was inverted where nothing was learned. `cut_jaw_1_deg` is the spindle angle
    at which jaw 1 was found for it, "file" where it is that of the job's file: what was learned was turned by the
    difference. `changed` is what was changed while it was cut, empty where nothing was. `fingerprint` says how it
    was clamped, where an indicator showed it, see `console.session.learning.fingerprint`.
    """

    compensation: str
    strategy: str
    stage: str
    inverted: str
    cut_jaw_1_deg: str = AS_FILED
    changed: str = ""
    fingerprint: str = ""

    def __str__(self) -> str:
        changed = f" · {self.changed}" if self.changed else ""
        return f"{self.compensation} · {self.strategy} · {self.stage} · {self.inverted}{changed}"

    @property
    def version(self) -> str | None:
        """The learned version, None for the model's."""
        return None if self.compensation == NONE else self.compensation

    def event(self) -> dict[str, object]:
        """Return it as the run record keeps it; None is the model's compensation, and jaw 1 as filed."""
        jaw_1_deg = None if self.cut_jaw_1_deg == AS_FILED else float(self.cut_jaw_1_deg)
        version = None if self.version is None else int(self.version)
        return {**self.header(), "compensation": version, CUT_JAW: jaw_1_deg}

    def header(self) -> dict[str, str]:
        """Return it as header lines of a trace."""
        return {key: value for key, value in asdict(self).items() if key not in (CHANGED, FINGERPRINT) or value}


KEYS = ("compensation", "strategy", "stage")  # what must be known of a cut
_ALL_KEYS = (
    *KEYS,
    INVERTED,
    CUT_JAW,
    CHANGED,
    FINGERPRINT,
)  # the others default to the model's response and jaw 1 as filed


def made_with(said: Mapping[str, str], trace: Mapping[str, str], made: Sequence[MadeWith | None]) -> MadeWith:
    """Return how a part was cut, from `said` and the header lines of its `trace`.

    Missing values are those of the last part in `made`, newest first; None there is a part recorded only as cut.

    Raises:
        SessionError: `learned.other_version`, they contradict each other, or no such part was cut;
            `learned.cut_unknown`, no source states it.
    """
    stated = _join_stated(said, trace)
    known = [each for each in made if each is not None]
    fitting = [each for each in known if stated.items() <= asdict(each).items()]
    missing = [key for key in KEYS if key not in stated]
    if not missing and not fitting:
        whole = MadeWith(**{INVERTED: MODEL, **stated})
        if known and None not in made:
            raise _other_version_error("", str(whole), " | ".join(dict.fromkeys(map(str, known))))
        return whole
    if (made and made[0] is None and "compensation" in missing) or not fitting:
        raise SessionError(Problem(code="learned.cut_unknown", key=", ".join(f"--{key}" for key in missing)))
    return fitting[0]


def _join_stated(said: Mapping[str, str], trace: Mapping[str, str]) -> dict[str, str]:
    stated = {key: trace[key] for key in _ALL_KEYS if key in trace}
    for key in _ALL_KEYS:
        if key in said and stated.setdefault(key, said[key]) != said[key]:
            raise _other_version_error(key, said[key], stated[key])
    return stated


def _other_version_error(key: str, value: str, limit: str) -> SessionError:
    return SessionError(Problem(code="learned.other_version", key=key, value=value, limit=limit))


def parts_made(cuts: Sequence[Cut]) -> list[MadeWith | None]:
    """Return how the parts of these cuts were made, None if it is not recorded."""
    return [made for kind, data, _ in cuts for made in _event_parts(kind, data)]


def date_problems(cuts: Sequence[Cut], job: str) -> tuple[Problem, ...]:
    """Return `record.date_ahead` for the first cut of a job that is dated in the future."""
    return ahead_problems("record.date_ahead", (at_utc for _, _, at_utc in cuts), key=job)


def cuts_of(folder: Path, asked: HoldsFor) -> list[Cut]:
    """Return the cuts of this job on this machine, newest first; refuses an unreadable record.

    If `asked` names a simulated lathe, those of other simulated lathes are left out.

    Raises SessionError: `learned.lathe_not_recorded`, parts of other simulated lathes are recorded, none of this.
    """
    found = _rows(folder, _QUERY, asked)
    ours = [(kind, data, at_utc) for kind, data, at_utc, which in found if not is_other_lathe(asked.lathe, which)]
    if not ours and any(_event_parts(kind, data) for kind, data, _, _ in found):
        others = tuple(dict.fromkeys(printable(str(which), 60) for *_, which in found))
        limit = " | ".join((*others[:MOST_NAMED], *(("…",) if len(others) > MOST_NAMED else ())))
        raise SessionError(
            Problem(code="learned.lathe_not_recorded", value=printable(asked.lathe, 60), limit=limit)
        )
    return ours


def is_other_lathe(stated: str, recorded: str | None) -> bool:
    """Whether two simulated lathes differ; an unknown one differs from none."""
    return bool(stated and recorded) and stated != recorded


@dataclass(frozen=True, slots=True, kw_only=True)
class CutPart:
    """A part that was cut: how, in which run, when its cut ended, and whether another was begun since.

    `run_id` is None while its run is open.
    `tool_lobe_um` is the tool error of the cut at the order of the lobe, `push_um` the push at its entry
    beyond what its path makes up for, 0 where the record does not have it.
    `lathe` is the simulated lathe that has cut it, "" where the record names none.
    `force` is what the cutting force said of a half-stage cut, None where it was not asked. `proven` is False
    where the record says that the cut is not proven to be the planned one.
    """

    made: MadeWith
    run_id: str | None = None
    at_utc: str = ""
    cut_since: bool = False
    lathe: str = ""
    tool_lobe_um: complex = 0j
    push_um: float = 0.0
    force: ForceNull | None = None
    proven: bool = True


def newest_part(folder: Path, asked: HoldsFor) -> CutPart | None:
    """Return the newest part of this job on this machine, None without one; refuses an unreadable record."""
    for kind, data, at_utc, which, run_id, cut_since in _rows(folder, _NEWEST, asked):
        for made in _event_parts(kind, data):
            if made is None:
                return None
            return CutPart(
                run_id=run_id,
                made=made,
                at_utc=at_utc,
                cut_since=bool(cut_since),
                lathe=which or "",
                tool_lobe_um=tool_lobe_um(data),
                push_um=push_um(data),
                force=force_of(data),
                proven=from_json(data).get("cut_verdict") != NOT_PROVEN,
            )
    return None


def tool_event(lobe_um: complex, push_um: float) -> dict[str, object]:
    """Return the tool error at the order of the lobe, and the push, as the run record keeps them."""
    return {TOOL_LOBE: [lobe_um.real, lobe_um.imag], PUSH: push_um}


def tool_lobe_um(data: str) -> complex:
    """Return the tool error of a cut at the order of the lobe; 0 where its event does not have it."""
    try:
        real, imaginary = (number(each) for each in from_json(data)[TOOL_LOBE])
    except (ValueError, TypeError, KeyError):
        return 0j
    return complex(real, imaginary)


def push_um(data: str) -> float:
    """Return the push on the tool in a cut that its path did not compensate, um; 0 if not recorded."""
    event = from_json(data)
    return number_or_none(event.get(PUSH)) or 0.0 if isinstance(event, dict) else 0.0


def _rows(folder: Path, query: str, asked: HoldsFor) -> list[Any]:
    import sqlite3

    from console.session.data.record_file import FILE_NAME, record_error, rows

    try:
        return rows(folder, query, (int(asked.simulated), asked.job_sha256, asked.machine_sha256), LOCK_TIMEOUT_S)
    except sqlite3.Error as error:
        raise record_error("record.unreadable", folder / FILE_NAME, error) from error


def _event_parts(kind: str, data: str) -> list[MadeWith | None]:
    """Return the part of an event; nothing for an air cut, or for a series of parts that learns by itself."""
    try:
        event = from_json(data)
        strategy, stage, inverted = (text(event[key]) for key in ("strategy", "stage", INVERTED))
        version, jaw_1_deg = event["compensation"], event.get(CUT_JAW)
        made = MadeWith(
            compensation=NONE if version is None else str(whole_number(version)),
            strategy=strategy,
            stage=stage,
            inverted=inverted,
            cut_jaw_1_deg=AS_FILED if jaw_1_deg is None else str(number(jaw_1_deg)),
            changed=text(event.get(CHANGED, "")),
            fingerprint=text(event.get(FINGERPRINT, "")),
        )
    except (ValueError, TypeError, KeyError):
        # Damaged: a cut all the same, so the newest part is not taken for an older one.
        return [None] if kind == "cut" else []
    return [] if stage == AIR or "passes" in event else [made]


UNDATED = datetime.min.replace(tzinfo=UTC)

PART_COLUMNS = (
    "part",
    "product",
    "ront_um",
    "tolerance_um",
    "passed",
    "diameter_mm",
    "nominal_diameter_mm",
    "diameter_tolerance_um",
    "lobe_um_pp",
    "trace_name",
)
"""Columns of `measurements` that are fields of `RecordedPart`."""

_BOOLEAN = ("product", "passed")
SECTION_KEYS = ("z_mm", "RONt_um", "mean_um")
CYLINDRICITY_LIMIT = "cylindricity_tolerance_um"  # of the figures of a part
UNCERTAINTY = "uncertainty"  # of the figures of a part, as `UncertaintyBudget.event` has it


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedPart:
    """A measured part of a run.

    `ront_um` is None of one measured in points that are no sections: then `data` has its form, and no harmonics.
    `part` names it among those of its run, empty for the only one; `product` is False of one that was cut for
    comparison. `data` has the parameters, the harmonics ("harmonics": n, amplitude_um, phase_deg) and the proposed
    learning step ("learning"). `trace` are the bytes of the trace's file, as `parse_sections` takes
    them; None where it was not kept or cannot be read. `trace_name` is that of an imported file. `number`, `at`
    and `trace_sha256` are given by the record, as is how its run was cut; None is not recorded. `compensation` and
    `inverted` are those of `RunRow`.
    """

    ront_um: float | None
    part: str = ""
    product: bool = True
    tolerance_um: float | None = None
    passed: bool | None = None
    diameter_mm: float | None = None
    nominal_diameter_mm: float | None = None
    diameter_tolerance_um: float | None = None
    lobe_um_pp: float | None = None
    trace_name: str | None = None
    trace: bytes | None = field(default=None, repr=False)
    data: Mapping[str, Any] = field(default_factory=dict)
    number: int = 0
    at: datetime = UNDATED
    trace_sha256: str | None = None
    run_id: str = ""
    strategy: str = ""
    stage: str | None = None
    compensation: str | None = None
    inverted: str | None = None

    @property
    def is_full(self) -> bool:
        """Whether it was cut with all of its compensation, as far as that is recorded."""
        return self.stage in (None, FULL)

    @property
    def has_its_trace(self) -> bool:
        """Whether its trace, if it was kept, has the recorded hash."""
        same = (None, None if self.trace is None else sha256(self.trace).hexdigest())
        return self.trace is None or self.trace_sha256 in same

    @property
    def sections(self) -> tuple[SectionForm, ...]:
        """Its sections, if it was measured over its length; none if they cannot be read."""
        try:
            read = [[number(each[key]) for key in SECTION_KEYS] for each in self.data.get("sections", ())]
        except (TypeError, ValueError, KeyError):
            return ()
        return tuple(SectionForm(z_mm=z_mm, ront_um=ront_um, mean_um=mean_um) for z_mm, ront_um, mean_um in read)

    @property
    def worst(self) -> tuple[float | None, float | None]:
        """RONt of its least round section, and its Z; of the only one without Z."""
        form = form_of(self.data)
        known = form["worst_ront_um"] is not None
        return (form["worst_ront_um"], form["worst_z_mm"]) if known else (self.ront_um, None)

    @property
    def length_causes(self) -> tuple[LengthCause, ...]:
        """Why its sections differ, as it was recorded; nothing if that cannot be read."""
        try:
            listed = [{**each, "kind": LengthCauseKind(each["kind"])} for each in self.data.get(CAUSES, ())]
            return tuple(LengthCause(**each) for each in listed)
        except (TypeError, ValueError, KeyError):
            return ()

    @property
    def judged(self) -> tuple[JudgedFigure, ...]:
        """Its figures against their limits."""
        limits = Tolerances(
            roundness_um=self.tolerance_um,
            cylindricity_um=number_or_none(self.data.get(CYLINDRICITY_LIMIT)),
            diameter_um=self.diameter_tolerance_um,
        )
        return judge_part(
            limits,
            ront_um=self.ront_um,
            mean_um=number_or_none(self.data.get("mean_deviation_um")) or 0.0,
            off_um=self.off_nominal_um,
            sections=self.sections,
            taper_um=number_or_none(self.data.get("taper_um")) or 0.0,
            cylt_um=number_or_none(self.data.get("CYLt_um")),
            uncertainty=self.uncertainty,
        )

    @property
    def uncertainty(self) -> FigureUncertainty | None:
        """Its recorded uncertainty; None if it has none, or one that cannot be read."""
        found = self.data.get(UNCERTAINTY)
        if not isinstance(found, Mapping) or found.get("decision_rule") not in [*DecisionRule]:
            return None
        return FigureUncertainty(
            rule=DecisionRule(found["decision_rule"]),
            roundness_um=number_or_none(found.get("RONt_U_um")),
            cylindricity_um=number_or_none(found.get("CYLt_U_um")),
            diameter_um=number_or_none(found.get("diameter_U_um")),
            expired=str(found.get("gauge_expired") or ""),
        )

    def figure(self, kind: ToleranceKind) -> JudgedFigure | None:
        """Return one of its figures against its limit, None if it has none."""
        return figure_of(kind, self.judged)

    @property
    def is_round(self) -> bool | None:
        """Whether RONt is within its tolerance in each section; the recorded verdict without one."""
        figure = self.figure(ToleranceKind.ROUNDNESS)
        return self.passed if figure is None else figure.passes

    @property
    def off_nominal_um(self) -> float | None:
        """Oversize of the mean diameter, um; None if it or the nominal one is unknown."""
        if self.diameter_mm is None or self.nominal_diameter_mm is None:
            return None
        return 1000.0 * (self.diameter_mm - self.nominal_diameter_mm)

    @property
    def is_good(self) -> bool | None:
        """Whether its figures are within their tolerances; a size that was not measured is not judged.

        None if nothing fails, but its cylindricity was not measured.
        """
        return False if self.is_round is False else passes_all(self.judged)

    @property
    def is_open(self) -> bool:
        """Whether it was to be good, and a figure is proven neither way."""
        return self.passed is None and self.is_full and any(each.is_open for each in self.judged)

    def read_trace(self) -> Trace | None:
        """Parse the trace of the judged section, with the operator's answers in its header; None without one.

        The error of its gauge is taken off where it was for the verdict.

        Raises ProfileError: it cannot be read.
        """
        if self.trace is None:
            return None
        sections, place = parse_sections(self.trace, where=self.trace_name or ""), self.data.get(SECTION)
        trace = sections[place if isinstance(place, int) and 0 <= place < len(sections) else 0].trace
        answers = self.data.get("answers")
        given = {k: v for k, v in answers.items() if isinstance(v, str)} if isinstance(answers, Mapping) else {}
        return take_error_off(replace(trace, meta=MappingProxyType({**trace.meta, **given})), self._gauge_error)

    @property
    def _gauge_error(self) -> GaugeError | None:
        """The error of its gauge, to be taken off the trace as it was filed; ProfileError: it is damaged."""
        if (kept := self.data.get(GAUGE_ERROR)) is None:
            return None
        try:
            return record(GaugeError, kept)
        except (TypeError, ValueError) as wrong:
            raise refusal_error(
                "file.unreadable", where=self.trace_name or "", value=printable(str(wrong))
            ) from wrong


def column_values(columns: Iterable[Any]) -> dict[str, Any]:
    """Return the values of `PART_COLUMNS`, as read from the file, by their names."""
    found = dict(zip(PART_COLUMNS, columns, strict=True))
    return {k: bool(v) if k in _BOOLEAN and v is not None else v for k, v in found.items()}


_SHOWN = ("reference_circle", "filter_upr", "state", "points", "eccentricity_um", "mean_deviation_um", "left_out")


def result_data(result: RoundnessResult) -> dict[str, object]:
    """Return the parameters and harmonics of a part; lengths in um, angles in degrees."""
    return {
        **{f"{name}_um": getattr(result, f"{name.lower()}_um") for name in ("RONt", "RONp", "RONv", "RONq")},
        **{name: getattr(result, name) for name in _SHOWN},
        "harmonics": [asdict(harmonic) for harmonic in result.harmonics],
    }
