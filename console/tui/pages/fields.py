"""Fields of the set-up form: format of a value, its limits, and how an entry was understood."""

from __future__ import annotations

from dataclasses import dataclass, replace

from console.session.station.state import StationState
from console.session.typed_number import stored_length
from console.session.work import NO_VALUE, Work, edit_field
from console.text.catalogue import Catalogue
from console.tui.ui_context import find_job_lock
from console.units import Units
from profiles.fields import Field, FieldType
from profiles.job import JOB_FIELDS, Job
from profiles.problem import Problem, ProfileError
from profiles.store import MOST_CHARACTERS, unfit_name

LOCKED = "screen.locked_moving", "screen.locked_armed"
NEXT_TO_NOTHING = 0.001  # fraction of the maximum below which a minimum is not worth its cells
_LIMITS = {field.key: field for field in JOB_FIELDS}


@dataclass(frozen=True, slots=True, kw_only=True)
class FormField:
    """One value of the form. `mark` precedes the number to give the kind of length: D, a diameter."""

    key: str
    heading: str
    decimals: int = 0
    mark: str = ""

    @property
    def rule(self) -> Field:
        """The job's rule for this field."""
        return _LIMITS[self.key]

    @property
    def has_choices(self) -> bool:
        """Whether the field steps through choices instead of taking an entry."""
        return self.rule.kind is FieldType.CHOICE

    @property
    def numeric(self) -> bool:
        """Whether the field takes a number."""
        return self.rule.kind in (FieldType.NUMBER, FieldType.WHOLE)


FORM: tuple[FormField, ...] = (
    FormField(key="material", heading="part"),
    FormField(key="diameter_mm", heading="part", decimals=3, mark="D "),
    FormField(key="wall_thickness_mm", heading="part", decimals=3),
    FormField(key="overhang_mm", heading="part", decimals=3),
    FormField(key="jaws", heading="chuck"),
    FormField(key="chucking_force_n", heading="chuck", decimals=1),
    FormField(key="depth_of_cut_mm", heading="cut", decimals=3),
    FormField(key="feed_mm_per_rev", heading="cut", decimals=3),
    FormField(key="spindle_speed_rpm", heading="cut", decimals=1),
    FormField(key="cut_length_mm", heading="cut", decimals=3),
    FormField(key="roundness_tolerance_um", heading="cut", decimals=1),
    FormField(key="cylindricity_tolerance_um", heading="cut", decimals=1),
    FormField(key="diameter_tolerance_um", heading="cut", decimals=1),
    FormField(key="lobe_error_source", heading="cut"),
)

STEPS = {
    "setup.next": 1,
    "setup.previous": -1,
    "setup.page_up": -5,
    "setup.page_down": 5,
    "setup.first": -len(FORM),
    "setup.last": len(FORM),
}
"""Fields that each key of the form goes down."""

_NAMED = {field.key for field in FORM} | {"lobe_error_um_pp"}


def format_field(field: FormField, job: Job, units: Units) -> str:
    """Return the value of a field in the shown units, without mark and unit, as it could be typed."""
    value = getattr(job, field.key)
    if value is None:
        return NO_VALUE
    return units.exact(value, field.rule.unit, field.decimals) if field.numeric else str(value)


def entry_of(field: FormField, work: Work, units: Units) -> str:
    """Return what an entry begins with: the value of the field, nothing for a missing one."""
    return "" if field.key in work.missing else format_field(field, work.job, units)


def with_unit(field: FormField, job: Job, units: Units) -> str:
    """Return the value of a field with mark and unit: "D 52.000 mm"."""
    unit = "" if getattr(job, field.key) is None else units.unit(field.rule.unit)
    return f"{field.mark}{format_field(field, job, units)} {unit}".strip()


def limit_of(field: FormField, units: Units) -> str:
    """Return what may be typed, as the rule of the field says it, in the shown unit: "> 0, <= 19.68503 in"."""
    rule = field.rule
    if units.unit(rule.unit) == rule.unit:
        return rule.limit
    pairs = (
        ("> ", rule.above, False),
        (">= ", rule.at_least, False),
        ("< ", rule.below, True),
        ("<= ", rule.at_most, True),
    )
    said = [
        f"{sign}{units.format_limit(bound, rule.unit, upper=up)}" for sign, bound, up in pairs if bound is not None
    ]
    return " ".join(filter(None, (", ".join(said), units.unit(rule.unit))))


def bounds(field: FormField, units: Units) -> str:
    """Return the limits in few cells, ">0 ≤500"; a negligible minimum is ">0", and stated under the form."""
    rule = field.rule
    if not field.numeric:
        return ""
    least, most = rule.at_least, rule.at_most
    tiny = least is not None and most is not None and 0 < least <= NEXT_TO_NOTHING * most
    pairs = ((">", 0.0 if tiny else rule.above), ("≥", None if tiny else least), ("<", rule.below), ("≤", most))
    shown = ((sign, bound, sign in ("<", "≤")) for sign, bound in pairs if bound is not None)
    return " ".join(f"{sign}{units.format_limit(bound, rule.unit, upper=upper)}" for sign, bound, upper in shown)


def why_not_changed(action: str, work: Work | None, state: StationState) -> tuple[Problem, ...]:
    """Return why an action of the form cannot be done now, without an open entry; empty if it can."""
    if work is None:
        return (Problem(code="screen.no_job"),)
    if action == "setup.undo" and not work.undo:
        return (Problem(code="screen.nothing_to_undo"),)
    lock = find_job_lock(state, *LOCKED)
    if lock is not None and action in ("setup.edit", "setup.undo", "setup.save_as"):
        return (lock,)
    if action == "setup.save_as" and work.missing:
        return (Problem(code="screen.values_missing", value=str(len(work.missing))),)
    return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class EntryResult:
    """Result of an entry: the work with it, or the problems and the work as it was."""

    work: Work
    problems: tuple[Problem, ...] = ()


def judge(work: Work, field: FormField, typed: str, units: Units) -> EntryResult:
    """Return how an entry in the shown units was understood; an empty or unchanged one keeps the value."""
    plain = typed.strip()
    # In inches what is shown may be rounded: an entry that is left as it began is no edit.
    if not plain or plain == entry_of(field, work, units):
        return EntryResult(work=work)
    unit, shown, limit = field.rule.unit, units.unit(field.rule.unit), limit_of(field, units)
    try:
        if field.numeric:
            typed = stored_length(typed, field.key, limit, unit, units)
        return EntryResult(work=edit_field(work, field.key, typed))
    except ProfileError as error:
        if shown == unit:
            return EntryResult(work=work, problems=tuple(error.problems))
        # The refusal quotes what was typed, and the range in the same unit.
        return EntryResult(
            work=work, problems=tuple(replace(each, value=plain, limit=limit) for each in error.problems)
        )


def name_field(problem: Problem, text: Catalogue) -> Problem:
    """Return the problem with its field named as in the form."""
    return replace(problem, key=text(f"setup.{problem.key}")) if problem.key in _NAMED else problem


def provenance(job: Job, text: Catalogue) -> str:
    """Return the source of a job's values: its source, or the job that it was copied from."""
    copied = text("jobs_page.copied_from", name=job.copied_from) if job.copied_from else ""
    return "; ".join(filter(None, (copied, job.source)))


def name_problem(name: str, taken: frozenset[str]) -> Problem | None:
    """Return why a job cannot be saved under this name; for a taken one the limit is a free name."""
    if problem := unfit_name(name):
        return problem
    if name in taken:
        return Problem(code="screen.name_taken", value=name, limit=free_name(name, taken))
    return None


def suggested_name(job: Job) -> str:
    """Return a name for a new job: its material and its diameter."""
    plain = "".join(character if character.isalnum() else "-" for character in job.material.lower()).strip("-")
    return f"{plain or 'part'}-{job.diameter_mm:g}"


def free_name(name: str, taken: frozenset[str]) -> str:
    """Return the name with the lowest number after it that makes it free."""
    place = 2
    while (free := f"{name[: MOST_CHARACTERS - 5]}-{place}") in taken:
        place += 1
    return free
