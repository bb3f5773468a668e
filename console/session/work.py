"""Current job: as saved, as edited, and what was computed from it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.session.data.kept_files import make_folder
from drivers.cutting.strategy import DEFAULT_STRATEGY
from profiles.fields import Field, Kind, fault, spelled
from profiles.job import JOB_FIELDS, Job, copy_of
from profiles.lobe.lobe_conditions import kept_condition
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedJob, LoadedMachine, load_job, save_job

if TYPE_CHECKING:
    from drivers.preview.preview import Preview, Underway
    from profiles.compensations.learned import LearnedCompensation

STAGES = ("full", "air", "partial")
"""In the order in which a key cycles through them; the values of `console.session.stages.Stage`."""

_FIELDS = {field.key: field for field in JOB_FIELDS}

_OF_LOBE = frozenset(key for key in _FIELDS if key.startswith("lobe_")) - {"lobe_error_source"}

# Python accepts more as a number ("1_000", "1e3", "nan") than an operator would write.
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """One job on one machine. `job` is what would be cut; `loaded` is the file that it came from.

    `outlook` and `preview` belong to exactly this job and machine: `outlook` is what is known so far, at once
    without a program, then with one after the other; `preview` is None until all are there. `preview_problems` say
    why neither can be. `undo` are the earlier values of the job, newest last.

    `compensation` is what was learned of this cut, None the model's. Later edits do not change it:
    `console.session.cut.compensated` judges whether it still applies. `set_aside` gives the reason why this cut
    does not use the newest accepted version; empty where it does, or there is none.
    """

    loaded: LoadedJob
    machine: LoadedMachine
    job: Job
    strategy: str = DEFAULT_STRATEGY.value
    compensation: LearnedCompensation | None = None
    set_aside: tuple[Problem, ...] = ()
    stage: str = STAGES[0]
    outlook: Underway | None = None
    preview: Preview | None = None
    preview_problems: tuple[Problem, ...] = ()
    undo: tuple[Job, ...] = field(default=())

    @property
    def edited(self) -> bool:
        """Whether the job differs from its file."""
        return self.job != self.loaded.job


def opened(loaded: LoadedJob, machine: LoadedMachine) -> Work:
    """Return the work on a job as it was saved."""
    return Work(loaded=loaded, machine=machine, job=loaded.job)


def parsed(text: str, key: str) -> Any:
    """Parse the value of a field as typed: a number with a point or a comma, or a word.

    Raises:
        ProfileError: `value.ambiguous` for "1,234" and "1.234.5" alike, `value.not_number`, `value.out_of_range`,
            and the others of `profiles.fields`, with the limits of the field.
    """
    field_ = _FIELDS[key]
    value = text.strip() if field_.kind in (Kind.TEXT, Kind.CHOICE) else _number(text.strip(), field_)
    code = fault(field_, value)
    if code:
        raise ProfileError(Problem(code=code, key=key, value=spelled(value), limit=field_.limit))
    return value


def edited(work: Work, key: str, text: str) -> Work:
    """Return the work with one field changed; results computed from the old job are discarded.

    A value entered by the operator is no longer an assumed one, except for those of the lobe, which nobody
    measured: the error is an assumed one from then on. The error stays with its cut, see `kept_condition`.
    """
    value = parsed(text, key)
    if getattr(work.job, key) == value:
        return work
    assumed = tuple(name for name in work.job.assumed if name != key)
    source = "assumed" if key in _OF_LOBE else work.job.lobe_error_source
    kept = kept_condition(work.loaded.job, key, value)
    job = replace(work.job, **{"assumed": assumed, "lobe_error_source": source, **kept, key: value})
    return _with_job(work, job, (*work.undo, work.job))


def undone(work: Work) -> Work:
    """Return the work before its last edit."""
    return _with_job(work, work.undo[-1], work.undo[:-1]) if work.undo else work


def _with_job(work: Work, job: Job, undo: tuple[Job, ...]) -> Work:
    return replace(work, job=job, undo=undo, outlook=None, preview=None, preview_problems=())


def with_strategy(work: Work, strategy: str) -> Work:
    """Return the work with another strategy to synchronise the tool with the spindle."""
    return replace(work, strategy=strategy)


def saved_as(work: Work, name: str, folder: Path) -> Work:
    """Save the job under another name in `folder`, created if missing, and return the work on that file.

    A copy takes over neither learned versions nor the sources of the values in the file.

    Raises:
        ProfileError: `file.exists`, `file.not_writable`, and the problems of the job; the work stays as it is.
    """
    path = folder / f"{name}.toml"
    make_folder(folder)
    save_job(copy_of(work.job, name, work.loaded.job.name), path, private=True)
    fresh = opened(load_job(str(path)), work.machine)
    return replace(fresh, strategy=work.strategy, stage=work.stage)


def _number(text: str, field_: Field) -> float | int | str:
    """Parse an entry; a text that is no number is returned unchanged, for the refusal to quote."""
    before, comma, after = text.partition(",")
    # A separator could mean thousands: more than one of them, or a comma before exactly three digits.
    thousands = bool(comma) and len(after) == 3 and before.lstrip("+-")[:1] not in ("0", "")
    if thousands or text.count(".") + text.count(",") > 1:
        raise ProfileError(Problem(code="value.ambiguous", key=field_.key, value=text, limit=field_.limit))
    plain = text.replace(",", ".")
    if not _NUMBER.fullmatch(plain):
        return text
    try:
        return int(plain) if field_.kind is Kind.WHOLE else float(plain)
    except ValueError:
        return text
