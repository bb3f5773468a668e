"""The job: one part, how it is held, how it is cut, and the lobe to be removed.

Plain values and their limits, no arithmetic beyond Eq 4 of Lee & Lee (2001). A job file is TOML; its keys
may stand at the top or inside any tables, each key once.

Note and tags are words for people, on which no cut depends: lines of the job's file, but no part of its hash. What
was learned of a job, and its records, are found by that hash, and a note must not take them away.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from profiles.fields import Field, FieldType, flatten, read_fields, schema_problem
from profiles.metrology.conformity import Tolerances
from profiles.problem import Problem, ProfileError

# Suffix of the source of a job whose lobe was found on a simulated part.
SIMULATED_SOURCE = "lobe of a simulated part, for practice"
NO_LOBE = "none"
"""Source of the lobe error of a job whose lobe is not known yet: the error is 0, only a plain cut can be made."""

LOBE_ERROR_SOURCES = ("measured", "fitted", "model", "assumed", NO_LOBE)
LABELS = ("note", "tags")
TOLERANCES = ("roundness_tolerance_um", "cylindricity_tolerance_um", "diameter_tolerance_um")
"""Keys of what a finished part is judged by: no cut depends on them."""

_TEXT = rb'"(?:[^"\\\r\n]|\\[^\r\n])*"'
# A label in a line of its own, as this package writes it. In a sound job such a line is nothing else: no text of a
# job has a line break. A label that is spelled otherwise counts as content.
_LINE = re.compile(
    rb"^(\xef\xbb\xbf)?[ \t]*(?:note[ \t]*=[ \t]*"
    + _TEXT
    + rb"|tags[ \t]*=[ \t]*\[(?:[ \t]*"
    + _TEXT
    + rb"[ \t]*,?)*[ \t]*\])[ \t]*(?:\r?\n|\Z)",
    re.MULTILINE,
)
_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A part in a chuck, as the operator describes it (compare Table 6 of the paper).

    A wall equal to the radius is a solid bar. `overhang_mm` is the length in front of the jaw faces.
    `chucking_force_n` is the total over all jaws, at rest. `depth_of_cut_mm` is on the radius.
    `lobe_error_um_pp` is the free-state error, peak to peak, that a plain cut leaves (the 55 and 33 um of the
    paper); the released part is high at spindle angle `lobe_phase_deg`: at jaw 1, or `lobe_past_jaw_deg` past
    it where that was found. `lobe_force_n` is the chucking force at which that error was found, and so are the
    other keys of the calibration cut: speed, overhang, wall, diameter, material, number of jaws, and the names
    of chuck and tool. A file that does not give one of them has its error at its own value. The error is that
    in the middle of the cut. `diameter_tolerance_um` is how far the finished diameter may be off either way, in
    each section, `cylindricity_tolerance_um` the limit of CYLt (minimum zone); None is not judged. `assumed` names
    the keys whose values the source does not give; `copied_from` is the job that this one was copied from, whose
    source does not apply. `note` and `tags` are words for people: no cut depends on them, and jobs that differ in
    nothing else are equal.
    """

    name: str
    material: str
    diameter_mm: float
    wall_thickness_mm: float
    overhang_mm: float
    jaws: int
    chucking_force_n: float
    depth_of_cut_mm: float
    feed_mm_per_rev: float
    spindle_speed_rpm: float
    cut_length_mm: float
    lobe_error_um_pp: float
    lobe_phase_deg: float
    lobe_error_source: str
    roundness_tolerance_um: float
    cylindricity_tolerance_um: float | None = None
    diameter_tolerance_um: float | None = None
    lobe_force_n: float | None = None
    lobe_spindle_speed_rpm: float | None = None
    lobe_overhang_mm: float | None = None
    lobe_wall_thickness_mm: float | None = None
    lobe_diameter_mm: float | None = None
    lobe_material: str | None = None
    lobe_jaws: int | None = None
    lobe_chuck: str | None = None
    lobe_tool: str | None = None
    lobe_past_jaw_deg: float | None = None
    assumed: tuple[str, ...] = ()
    source: str = ""
    copied_from: str | None = None
    note: str = field(default="", compare=False)
    tags: tuple[str, ...] = field(default=(), compare=False)
    schema: int = 1

    @property
    def radius_mm(self) -> float:
        """Half of the diameter."""
        return self.diameter_mm / 2

    @property
    def finished_radius_mm(self) -> float:
        """The mean radius after the cut."""
        return self.radius_mm - self.depth_of_cut_mm

    @property
    def finished_diameter_mm(self) -> float:
        """The nominal diameter after the cut."""
        return 2.0 * self.finished_radius_mm

    @property
    def tolerances(self) -> Tolerances:
        """What a finished part is judged by."""
        return Tolerances(
            roundness_um=self.roundness_tolerance_um,
            cylindricity_um=self.cylindricity_tolerance_um,
            diameter_um=self.diameter_tolerance_um,
        )

    @property
    def lobe_amplitude_um(self) -> float:
        """Half of the peak-to-peak error: A1 of Eq 7."""
        return self.lobe_error_um_pp / 2

    @property
    def error_force_n(self) -> float:
        """Chucking force that the lobe error belongs to."""
        return self.chucking_force_n if self.lobe_force_n is None else self.lobe_force_n

    @property
    def jaw_1_deg(self) -> float:
        """Spindle angle of jaw 1."""
        return self.lobe_phase_deg - (self.lobe_past_jaw_deg or 0.0)

    @property
    def lobe_frequency_hz(self) -> float:
        """Eq 4 for any number of jaws: f = N rpm / 60."""
        return self.jaws * self.spindle_speed_rpm / 60


def copy_of(job: Job, name: str, original: str) -> Job:
    """Return the job under another name. The source of the `original` file does not apply to a copy.

    That its lobe is from a simulated part is kept.
    """
    source = SIMULATED_SOURCE if job.source.endswith(SIMULATED_SOURCE) else ""
    return replace(job, name=name, source=source, copied_from=original)


# Minimum length, force and speed of a job: below these there is no part, and quotients become unphysical.
LEAST_MM, LEAST_N, LEAST_RPM = 0.001, 0.1, 0.1
LEAST_CUT_MM = 0.0001  # minimum depth and feed: a tenth of a micrometre


def _number(key: str, table: str, unit: str, at_least: float, at_most: float, *, optional: bool = False) -> Field:
    return Field(key=key, table=table, unit=unit, at_least=at_least, at_most=at_most, optional=optional)


_CONTENT = (
    Field(key="name", kind=FieldType.TEXT),
    Field(key="material", kind=FieldType.TEXT, table="workpiece"),
    _number("diameter_mm", "workpiece", "mm", LEAST_MM, 500),
    _number("wall_thickness_mm", "workpiece", "mm", LEAST_MM, 250),
    _number("overhang_mm", "workpiece", "mm", LEAST_MM, 1000),
    Field(key="jaws", kind=FieldType.WHOLE, table="chuck", at_least=2, at_most=12),
    _number("chucking_force_n", "chuck", "N", LEAST_N, 100_000),
    _number("depth_of_cut_mm", "cut", "mm", LEAST_CUT_MM, 5),
    _number("feed_mm_per_rev", "cut", "mm/rev", LEAST_CUT_MM, 1),
    _number("spindle_speed_rpm", "cut", "rpm", LEAST_RPM, 5000),
    _number("cut_length_mm", "cut", "mm", LEAST_MM, 1000),
    Field(key="lobe_error_um_pp", table="lobe", unit="um", at_least=0, at_most=1000),
    Field(key="lobe_phase_deg", table="lobe", unit="deg", at_least=-360, at_most=360),
    Field(key="lobe_error_source", kind=FieldType.CHOICE, table="lobe", choices=LOBE_ERROR_SOURCES),
    _number("roundness_tolerance_um", "lobe", "um", 0.001, 1000),
    _number("cylindricity_tolerance_um", "workpiece", "um", 0.001, 1000, optional=True),
    _number("diameter_tolerance_um", "workpiece", "um", 0.1, 10_000, optional=True),
    _number("lobe_force_n", "lobe", "N", LEAST_N, 100_000, optional=True),
    _number("lobe_spindle_speed_rpm", "lobe", "rpm", LEAST_RPM, 5000, optional=True),
    _number("lobe_overhang_mm", "lobe", "mm", LEAST_MM, 1000, optional=True),
    _number("lobe_wall_thickness_mm", "lobe", "mm", LEAST_MM, 250, optional=True),
    _number("lobe_diameter_mm", "lobe", "mm", LEAST_MM, 500, optional=True),
    Field(key="lobe_material", kind=FieldType.TEXT, table="lobe", optional=True),
    Field(key="lobe_jaws", kind=FieldType.WHOLE, table="lobe", at_least=2, at_most=12, optional=True),
    Field(key="lobe_chuck", kind=FieldType.TEXT, table="lobe", optional=True),
    Field(key="lobe_tool", kind=FieldType.TEXT, table="lobe", optional=True),
    Field(key="lobe_past_jaw_deg", table="lobe", unit="deg", at_least=-180, at_most=180, optional=True),
)

JOB_FIELDS: tuple[Field, ...] = (
    Field(key="schema", kind=FieldType.WHOLE, default=1, at_least=1, at_most=1),
    *_CONTENT,
    Field(key="note", kind=FieldType.TEXT, default=""),
    Field(key="tags", kind=FieldType.TEXTS, default=()),
    Field(key="source", kind=FieldType.TEXT, default=""),
    Field(key="copied_from", kind=FieldType.TEXT, optional=True),
    Field(key="assumed", kind=FieldType.TEXTS, default=(), choices=tuple(each.key for each in _CONTENT)),
)
"""Every key of a job with its limits, in the order in which a form or a file shows them."""


def job_from_table(table: Mapping[str, Any], *, where: str = "") -> Job:
    """Return the job in a TOML table (or in the values of a form).

    Raises `ProfileError` with every problem of the table; `where` is the file as the operator named it.
    """
    leaves, problems = flatten(table, where=where)
    if refusal := schema_problem(leaves, where=where):
        # The rest would be judged by the wrong schema.
        raise ProfileError(refusal)
    values, found = read_fields(JOB_FIELDS, leaves, where=where)
    if problems or found:
        raise ProfileError(*problems, *found)
    job = Job(**values)
    if job.lobe_error_source == NO_LOBE and job.lobe_error_um_pp:
        value = f"{job.lobe_error_um_pp:.6g} um"
        raise ProfileError(Problem(code="job.lobe_unknown", where=where, key="lobe_error_um_pp", value=value))
    return job


def hash_of_job(content: bytes) -> str:
    """Return the sha256, hexadecimal, of a job file without its labels: of the bytes, where it has none."""
    return hashlib.sha256(without_labels(content)).hexdigest()


def without_labels(content: bytes) -> bytes:
    """Return the bytes of a job file without the lines of its labels."""
    return _LINE.sub(rb"\1", content)


def with_labels(content: bytes, note: str, tags: Sequence[str]) -> bytes:
    """Return the bytes of a job file with these labels as its first lines; all other bytes stay."""
    plain = without_labels(content)
    mark = _MARK if plain.startswith(_MARK) else b""
    lines = [f"note = {_spell_toml_text(note)}\n"] if note else []
    lines += [f"tags = [{', '.join(map(_spell_toml_text, tags))}]\n"] if tags else []
    return mark + "".join(lines).encode() + plain.removeprefix(mark)


def _spell_toml_text(text: str) -> str:
    """Return a text of printable characters as TOML writes it, which is as JSON does."""
    import json  # not for the first page

    return json.dumps(text, ensure_ascii=False)
