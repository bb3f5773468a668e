"""A compensation that was learned from a part, with what it holds for; plain values, fit for a file.

Problem codes: `learned.file`; of one that is for something else `learned.job_changed`, `learned.machine_changed`,
`learned.strategy`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from profiles.compensations.path import CutPath, Wave
from profiles.own_values import read_own
from profiles.problem import Problem

SCHEMA = 1

MODEL = 0
"""The version that nobody has learned: the lobe of the job through the response of the machine profile."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldsFor:
    """What a compensation is for: job and machine with the hashes of their files, and how it is cut.

    What was learned on a simulated lathe is for simulated lathes.
    """

    job: str
    job_sha256: str
    machine: str
    machine_sha256: str
    simulated: bool
    strategy: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PartRead:
    """The part that something was learned from: how it was cut, and what was left on it.

    It was cut with the share `share` of `version` (0: of the model, nothing learned); `target` is the lobe of that
    path, tool into the work, `lobe` that of the released part, outwards, with the standard error of its amplitude.
    """

    version: int
    share: float
    target: Wave
    lobe: Wave
    lobe_sd_um: float
    ront_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedCompensation:
    """A path with its history: learned from `part`, which was cut with version `parent`, with `gain`.

    Versions count from 1. `reverts` is the version that this one is once more, with all that it had; 0 is the
    model, which has no part. None where it is a new one. `expected_ront_um` is the roundness that its part
    lets expect of the next one, None where nothing was written of that.
    `date` is UTC after ISO 8601.
    """

    holds_for: HoldsFor
    version: int
    parent: int
    gain: float
    path: CutPath
    part: PartRead | None
    date: str
    reverts: int | None = None
    expected_ront_um: float | None = None

    @property
    def is_model(self) -> bool:
        """Whether this version is the model once more, with nothing learned."""
        return self.reverts == MODEL


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedPart:
    """What a measured part lets expect of one that is cut with what it has taught.

    `ront_um` is its roundness, None where nothing was written of that; `lobe` that of the released part, outwards.
    """

    ront_um: float | None
    lobe: Wave

    def turned(self, by_deg: float) -> ExpectedPart:
        """Return the same of a chuck that is mounted so many degrees of spindle further on."""
        return replace(self, lobe=self.lobe.turned(by_deg))


def expected_part(learned: LearnedCompensation, share: float = 1.0) -> ExpectedPart | None:
    """Return what the part of a version lets expect of one that is cut with the share `share` of it.

    None of the model, which no part has taught. Of less than all of it the lobe alone is told, which outweighs the
    rest.
    """
    part = learned.part
    if part is None or learned.is_model:
        return None
    taken_um = share * learned.path.target.waves[0].coefficient
    left = Wave.of(part.lobe.lobes, part.lobe.coefficient + part.target.coefficient - taken_um)
    return ExpectedPart(ront_um=learned.expected_ront_um if share == 1.0 else 2.0 * left.amplitude_um, lobe=left)


def again(older: LearnedCompensation, number: int, date: str) -> LearnedCompensation:
    """Return an older version as a new one: nothing is taken back, and the one in between stays on record."""
    return replace(older, version=number, date=date, reverts=older.version)


def model_again(holds_for: HoldsFor, path: CutPath, number: int, date: str) -> LearnedCompensation:
    """Return the model as a new version."""
    return LearnedCompensation(
        holds_for=holds_for,
        version=number,
        parent=MODEL,
        gain=1.0,
        path=path,
        part=None,
        date=date,
        reverts=MODEL,
    )


def differences(learned: LearnedCompensation, asked: HoldsFor) -> tuple[Problem, ...]:
    """Return why a compensation may not be used for what is asked; job and machine have the same names."""
    holds, problems = learned.holds_for, []
    version = str(learned.version)
    for what in ("job", "machine"):
        then, now = getattr(holds, f"{what}_sha256"), getattr(asked, f"{what}_sha256")
        if then != now:
            problems.append(
                Problem(code=f"learned.{what}_changed", key=version, value=now[:6], limit=then[:6]),
            )
    if (holds.job, holds.machine, holds.simulated) != (asked.job, asked.machine, asked.simulated):
        value, limit = _side(asked), _side(holds)
        problems.append(Problem(code="learned.elsewhere", key=version, value=value, limit=limit))
    if holds.strategy != asked.strategy:
        problems.append(Problem(code="learned.strategy", key=version, value=asked.strategy, limit=holds.strategy))
    return tuple(problems)


def _side(holds: HoldsFor) -> str:
    return f"{holds.job}, {holds.machine}, {'simulated' if holds.simulated else 'machine'}"


def as_table(learned: LearnedCompensation) -> dict[str, Any]:
    """Return it as plain values for a file."""
    return {"schema": SCHEMA, **asdict(learned)}


def from_table(table: Any, where: str = "") -> LearnedCompensation:
    """Read what `as_table` has made.

    Raises:
        ProfileError: `schema.unsupported`; `learned.file`, anything else.
    """
    return read_own(LearnedCompensation, table, schema=SCHEMA, code="learned.file", where=where, judge=_judge)


def _judge(learned: LearnedCompensation) -> None:
    """Refuse a path that must not reach a machine."""
    if min(learned.version - 1, learned.parent, learned.reverts or 0) < 0 or not 0.0 < learned.gain <= 1.0:
        raise ValueError(f"version {learned.version}, gain {learned.gain}")
    part = learned.part
    waves = [*learned.path.target.waves, *learned.path.command.waves, *((part.target, part.lobe) if part else ())]
    if (least := min(wave.lobes for wave in waves)) < 1:
        raise ValueError(f"lobes {least}")
