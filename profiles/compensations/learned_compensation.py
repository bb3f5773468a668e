"""A learned compensation and what it is valid for; plain values, suitable for a file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

from profiles.compensations.path import AXIAL_POWERS, MOST_HARMONICS, AxialTerm, CutPath, PathHarmonic
from profiles.job import TOLERANCES, Job
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.strict_values import read_own, rename_keys

SCHEMA = 1
FILED = {"target": "wanted", "phase_deg": "crest_deg", "fraction": "share"}  # what files call these fields
SHAPING = ("controller", "tool", "spindle", "carriage", "chuck")  # sections of a machine profile
NOT_SHAPING = (
    *("name", "lobe_error_source", *TOLERANCES),
    *("assumed", "source", "copied_from", "note", "tags", "schema"),
)
"""Keys of a job on which no path depends."""

LIMITS = re.compile(
    r"I5|I([1-9]|[12]\d|3[0-2])(1[1-59]|2[0-58])"  # following error, travel, jogs, homing, flags
    r"|controller\.background_ms|spindle\.(max_speed_rpm|inertia_kg_m2|peak_torque_n_m)"
    r"|tool\.(peak|continuous|encoder_max|coil|back_emf|bus|travel)_\w+|carriage\.(travel_\w+|jaw_clearance_mm)"
    r"|chuck\.(jaw_\w+|max_force_n|safety_factor|force_sd_percent|work_mode_hz|force_line_variance|uncalibrated_\w+)"
)
"""Values of a machine profile that bound or predict a cut, and shape no path."""

OTHER_SETTINGS = "learned.settings_changed"
MOST_SHOWN = 4  # changed values in a sentence
MODEL = 0  # the version without learning: the lobe of the job through the response of the machine profile


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldsFor:
    """What a compensation is valid for: job and machine with the hashes of their files, and the strategy.

    What was learned on a simulated lathe is valid for simulated lathes only, and for that one: `lathe` says which,
    empty where that is not known, and for a real machine. `settings` are the values of both that shape the path.
    """

    job: str
    job_sha256: str
    machine: str
    machine_sha256: str
    simulated: bool
    strategy: str
    lathe: str = ""
    settings: Mapping[str, str] = field(default_factory=dict, hash=False)


def path_settings(job: Job, machine: MachineProfile) -> dict[str, str]:
    """Return the values of a job and a machine that shape a path, as texts; variables by their names."""
    found = {each.name: getattr(job, each.name) for each in fields(job) if each.name not in NOT_SHAPING}
    for name in SHAPING:
        section = getattr(machine, name)
        found |= {f"{name}.{each.name}": getattr(section, each.name) for each in fields(section)}
    found |= found.pop("controller.variables")
    return {key: _as_text(each) for key, each in found.items()}


def _as_text(value: object) -> str:
    return f"{value:.10g}" if type(value) is float else str(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampingReading:
    """The fingerprint of a part's clamping: the factor of its lobe, and the deflection that the indicator showed.

    The lobe became `height` times as high, and was turned by `turn_deg` of spindle. `felt` is the lobe at rest
    that corresponds to the deflection, with the standard deviation of each of its components.
    """

    height: float
    turn_deg: float
    felt: PathHarmonic
    felt_sd_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PartReading:
    """The part that a version was learned from: its cut, and its remaining lobe.

    It was cut with `fraction` of `version` (0: of the model, nothing learned); `target` is the lobe
    of that path, tool into the work, `lobe` that of the released part, outwards, with the standard error of its
    amplitude. `plain` are the other harmonics of the part as it would have been without a path. Of a part that was
    `clamped` by its fingerprint, all of it is as it would have been in the mean clamping. `tool` is the
    tool error of that cut at the order of the lobe, infeed positive; None if unknown. `axial` is what its sections
    have shown along Z, as it would have been without a path beside the known one.
    """

    version: int
    fraction: float
    target: PathHarmonic
    lobe: PathHarmonic
    lobe_sd_um: float
    ront_um: float
    plain: tuple[PathHarmonic, ...] = ()
    clamped: ClampingReading | None = None
    tool: PathHarmonic | None = None
    axial: tuple[AxialTerm, ...] = ()

    def plain_um(self, order: int) -> complex | None:
        """Return an order as the part would have had it without a path, None where that is not recorded."""
        if order == self.lobe.lobes:
            return self.lobe.coefficient + self.target.coefficient
        return next((each.coefficient for each in self.plain if each.lobes == order), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedCompensation:
    """A path with its history: learned from `part`, which was cut with version `parent`, with `gain`.

    Versions count from 1. `reverts` is the version that this one restores unchanged; 0 is the model, which has
    no part; None for a new one. `expected_ront_um` is the roundness that its part predicts for the next, None
    where not recorded. `date` is UTC after ISO 8601. `gain` is that of the lobe, `frozen` are orders that grew.
    """

    holds_for: HoldsFor
    version: int
    parent: int
    gain: float
    path: CutPath
    part: PartReading | None
    date: str
    reverts: int | None = None
    expected_ront_um: float | None = None
    frozen: tuple[int, ...] = ()

    @property
    def is_model(self) -> bool:
        """Whether this version restores the model, with nothing learned."""
        return self.reverts == MODEL


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedPart:
    """The result that a measured part predicts for a cut with the compensation learned from it.

    `ront_um` is its roundness, None if not recorded; `lobe` that of the released part, outwards.
    """

    ront_um: float | None
    lobe: PathHarmonic

    def turn_by(self, by_deg: float) -> ExpectedPart:
        """Return the same for a chuck mounted so many degrees of spindle further on."""
        return replace(self, lobe=self.lobe.turn_by(by_deg))


def expected_part(learned: LearnedCompensation, fraction: float = 1.0) -> ExpectedPart | None:
    """Return the prediction for a part cut with `fraction` of a version.

    None for the model, which was not learned from a part. For less than all of it only the lobe is given, which
    dominates.
    """
    part = learned.part
    if part is None or learned.is_model:
        return None
    taken_um = fraction * learned.path.target.harmonics[0].coefficient
    left = PathHarmonic.from_coefficient(
        part.lobe.lobes, part.lobe.coefficient + part.target.coefficient - taken_um
    )
    return ExpectedPart(
        ront_um=learned.expected_ront_um if fraction == 1.0 else 2.0 * left.amplitude_um, lobe=left
    )


def renew_version(older: LearnedCompensation, number: int, date: str) -> LearnedCompensation:
    """Return an older version as a new one: nothing is deleted, and the one in between stays on record."""
    return replace(older, version=number, date=date, reverts=older.version)


def model_again(holds_for: HoldsFor, path: CutPath, number: int, date: str) -> LearnedCompensation:
    """Return the model as a new version."""
    return LearnedCompensation(
        holds_for=holds_for, version=number, parent=MODEL, gain=1.0, path=path, part=None, date=date, reverts=MODEL
    )


def history_of(
    version: LearnedCompensation | None, known: tuple[LearnedCompensation, ...]
) -> tuple[LearnedCompensation, ...]:
    """Return the versions that led to one, oldest first; it is the last."""
    by_number = {each.version: each for each in known}
    found: list[LearnedCompensation] = []
    while version is not None:
        found.insert(0, version)
        version = by_number.get(version.parent) if version.parent < version.version else None
    return tuple(found)


def differences(learned: LearnedCompensation, asked: HoldsFor) -> tuple[Problem, ...]:
    """Return why a compensation is not valid for the request; job and machine have the same names."""
    holds, problems = learned.holds_for, list[Problem]()
    version = str(learned.version)
    if changed := changed_settings(holds, asked):
        problems.append(Problem(code="learned.settings_changed", key=version, value=changed))
    if (holds.job, holds.machine, holds.simulated) != (asked.job, asked.machine, asked.simulated):
        value, limit = _side(asked), _side(holds)
        problems.append(Problem(code="learned.elsewhere", key=version, value=value, limit=limit))
    if holds.lathe and asked.lathe and holds.lathe != asked.lathe:
        problems.append(Problem(code="learned.other_lathe", key=version, value=asked.lathe, limit=holds.lathe))
    if holds.strategy != asked.strategy:
        problems.append(Problem(code="learned.strategy", key=version, value=asked.strategy, limit=holds.strategy))
    return tuple(problems)


def changed_settings(holds: HoldsFor, asked: HoldsFor) -> str:
    """Return which values are no longer those that a version was learned with, "" where none.

    Files with the same bytes have the same values, but for what a calibration has put into them.
    """
    if (holds.job_sha256, holds.machine_sha256) == (asked.job_sha256, asked.machine_sha256):
        return ""
    then, now = holds.settings, asked.settings
    keys = [each for each in {**then, **now} if then.get(each) != now.get(each) and not LIMITS.fullmatch(each)]
    keys.sort(
        key=lambda each: "." in each
    )  # what the controller or the job has, before what the profile says of it
    shown = [f"{key} {then.get(key, '-')} → {now.get(key, '-')}" for key in keys[:MOST_SHOWN]]
    return ", ".join(shown + [f"+ {len(keys) - MOST_SHOWN}"] * (len(keys) > MOST_SHOWN))


def _side(holds: HoldsFor) -> str:
    return f"{holds.job}, {holds.machine}, {'simulated' if holds.simulated else 'machine'}"


def as_table(learned: LearnedCompensation) -> dict[str, Any]:
    """Return the compensation as plain values for a file."""
    table: dict[str, Any] = rename_keys(asdict(learned), FILED)
    return {"schema": SCHEMA, **table}


def from_table(table: Any, where: str = "") -> LearnedCompensation:
    """Read the output of `as_table`.

    Raises `ProfileError`: `schema.unsupported`; `learned.file`, anything else.
    """
    table = rename_keys(table, {filed: name for name, filed in FILED.items()})
    return read_own(LearnedCompensation, table, schema=SCHEMA, code="learned.file", where=where, judge=_judge)


def _judge(learned: LearnedCompensation) -> None:
    """Refuse a path that must not reach a machine."""
    if min(learned.version - 1, learned.parent, learned.reverts or 0) < 0 or not 0.0 < learned.gain <= 1.0:
        raise ValueError(f"version {learned.version}, gain {learned.gain}")
    part = learned.part
    harmonics = [
        *learned.path.target.harmonics,
        *learned.path.command.harmonics,
        *((part.target, part.lobe, *part.plain) if part else ()),
        *((part.clamped.felt,) if part and part.clamped else ()),
        *((part.tool,) if part and part.tool else ()),
    ]
    if part and part.clamped and not (part.clamped.height > 0.0 and part.clamped.felt_sd_um > 0.0):
        raise ValueError(f"height {part.clamped.height}, felt_sd_um {part.clamped.felt_sd_um}")
    if (least := min(harmonic.lobes for harmonic in harmonics)) < 1:
        raise ValueError(f"lobes {least}")
    for term in (*learned.path.target.axial, *learned.path.command.axial, *(part.axial if part else ())):
        if not (0 <= term.lobes <= MOST_HARMONICS and term.power in AXIAL_POWERS):
            raise ValueError(f"lobes {term.lobes}, power {term.power}")
