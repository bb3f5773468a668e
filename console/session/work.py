"""Current job: as saved, as edited, and what was computed from it; and a new one that is being filled in."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.session.data.kept_files import make_folder
from console.session.typed_number import plain_number
from drivers.cutting.strategy import DEFAULT_STRATEGY, UNCOMPENSATED
from profiles.fields import Field, FieldType, fault, spell_toml
from profiles.files import printable
from profiles.job import JOB_FIELDS, LABELS, NO_LOBE, TOLERANCES, Job, copy_of
from profiles.lobe.lobe_conditions import kept_condition
from profiles.lobe.lobe_origin import MODEL, with_lobe_of, with_modelled_lobe, without_lobe
from profiles.problem import Problem, ProfileError
from profiles.store import BUNDLED_JOBS, LoadedJob, LoadedMachine, load_job, save_job

if TYPE_CHECKING:
    from console.session.data.identified_responses import ChosenResponse
    from drivers.preview.preview import PartialPreview, Preview
    from profiles.compensations.learned_compensation import LearnedCompensation

STAGES = ("full", "air", "partial")
"""In the order in which a key cycles through them; the values of `console.session.stages.Stage`."""

_FIELDS = {field.key: field for field in JOB_FIELDS}

_OF_LOBE = frozenset(key for key in _FIELDS if key.startswith("lobe_")) - {"lobe_error_source"}
_NOT_OF_A_CUT = frozenset({"name", *TOLERANCES, "source", "copied_from", "assumed", *LABELS})

NO_FOLDER = Path("/nonexistent")
"""Folder of a job that has no file yet."""

REQUIRED = tuple(
    field.key
    for field in JOB_FIELDS
    if field.required and field.key != "name" and not field.key.startswith("lobe_")
)
"""Values that a new job needs, in the order of its form."""

NO_VALUE = "-"

# Python accepts more as a number ("1_000", "1e3", "nan") than an operator would write.


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """One job on one machine. `job` is what would be cut; `loaded` is the file that it came from.

    `outlook` and `preview` belong to exactly this job and machine: `outlook` is what is known so far, at once
    without a program, then with one after the other; `preview` is None until all are there. `preview_problems` say
    why neither can be. `undo` are the earlier values of the job, with what was missing then, newest last.

    `compensation` is what was learned of this cut, None the model's. Later edits do not change it:
    `console.session.cut.compensated_cut` judges whether it still applies. `set_aside` gives the reason why this
    cut does not use the newest accepted version; empty where it does, or there is none. `inverts` is the
    identified response that the cut inverts, None the model's; nothing learned is used with it.

    `missing` are the values of a new job that nobody has given yet: what `job` has there means nothing. Such a
    work exists on the page Set-up alone.
    """

    loaded: LoadedJob
    machine: LoadedMachine
    job: Job
    strategy: str = DEFAULT_STRATEGY.value
    compensation: LearnedCompensation | None = None
    set_aside: tuple[Problem, ...] = ()
    inverts: ChosenResponse | None = None
    stage: str = STAGES[0]
    outlook: PartialPreview | None = None
    preview: Preview | None = None
    preview_problems: tuple[Problem, ...] = ()
    undo: tuple[tuple[Job, frozenset[str]], ...] = field(default=())
    missing: frozenset[str] = frozenset()

    @property
    def edited(self) -> bool:
        """Whether the job differs from its file."""
        return self.job != self.loaded.job

    @property
    def is_new(self) -> bool:
        """Whether the job has no file yet."""
        return self.loaded.path.parent == NO_FOLDER

    @property
    def is_own(self) -> bool:
        """Whether the job has a file of the operator's own, which may be written over."""
        return not self.is_new and self.loaded.path.parent != BUNDLED_JOBS


def open_work(loaded: LoadedJob, machine: LoadedMachine) -> Work:
    """Return the work on a job as it was saved; without a known lobe the cut is a plain one."""
    strategy = UNCOMPENSATED if loaded.job.lobe_error_source == NO_LOBE else DEFAULT_STRATEGY
    return Work(loaded=loaded, machine=machine, job=loaded.job, strategy=strategy.value)


def blank_form(machine: LoadedMachine) -> Work:
    """Return the work on a new job: all of its values are missing, and no lobe is known yet."""
    values = {key: _placeholder(_FIELDS[key]) for key in (*REQUIRED, "lobe_error_um_pp", "lobe_phase_deg")}
    job = Job(**values, name="", lobe_error_source=NO_LOBE, assumed=("lobe_phase_deg",))
    loaded = LoadedJob(job=job, path=NO_FOLDER / "new", sha256="")
    return replace(open_work(loaded, machine), missing=frozenset(REQUIRED))


def _placeholder(field_: Field) -> Any:
    return (
        "?"
        if field_.kind is FieldType.TEXT
        else int(field_.at_least or 0)
        if field_.kind is FieldType.WHOLE
        else 0.0
    )


def parse_field(text: str, key: str) -> Any:
    """Parse the value of a field as typed: a number with a point or a comma, or a word; "-" for no optional value.

    Raises:
        ProfileError: `value.ambiguous` for "1,234" and "1.234.5" alike, `value.not_number`, `value.out_of_range`,
            and the others of `profiles.fields`, with the limits of the field.
    """
    field_ = _FIELDS[key]
    if field_.optional and text.strip() == NO_VALUE:
        return None
    value = (
        text.strip() if field_.kind in (FieldType.TEXT, FieldType.CHOICE) else entered_number(text.strip(), field_)
    )
    code = fault(field_, value)
    if code:
        raise ProfileError(Problem(code=code, key=key, value=spell_toml(value), limit=field_.limit))
    return value


def edit_field(work: Work, key: str, text: str) -> Work:
    """Return the work with one field changed; results computed from the old job are discarded.

    A value entered by the operator is no longer an assumed one, except for those of the lobe, which nobody
    measured: the error is an assumed one from then on. An error that was found on a part stays with its cut, see
    `kept_condition`; one by the model is predicted anew, or unknown where the model cannot be applied.
    """
    value = parse_field(text, key)
    if getattr(work.job, key) == value and key not in work.missing:
        return work
    assumed = tuple(name for name in work.job.assumed if name != key)
    before = work.job.lobe_error_source
    source = "assumed" if key in _OF_LOBE else before
    kept = {} if before in (MODEL, NO_LOBE) else kept_condition(work.loaded.job, key, value)
    job = replace(work.job, **{"assumed": assumed, "lobe_error_source": source, **kept, key: value})
    changes = key not in _OF_LOBE | _NOT_OF_A_CUT or work.missing
    if before == MODEL and changes and not work.missing - {key}:
        job = _with_predicted_lobe(work, job)
    return _with_job(work, job, missing=work.missing - {key})


def _with_predicted_lobe(work: Work, job: Job) -> Job:
    """Return a changed job with its lobe by the model, none where that does not apply; its file has its own."""
    filed = work.loaded.job
    part = _FIELDS.keys() - _OF_LOBE - _NOT_OF_A_CUT
    if all(getattr(job, key) == getattr(filed, key) for key in part):
        return with_lobe_of(job, filed)
    try:
        return with_modelled_lobe(job, work.machine.machine)
    except ProfileError:  # the findings say what is wrong with the part
        return without_lobe(job)


def lobe_choices(work: Work) -> tuple[str, ...]:
    """Return the sources that the lobe of this job may have: that of its file, none yet, the model."""
    filed = work.loaded.job.lobe_error_source
    return tuple(dict.fromkeys((filed, NO_LOBE, MODEL)))


def with_lobe_from(work: Work, source: str) -> Work:
    """Return the work with its lobe from this one of its `lobe_choices`.

    Raises `ProfileError`: the model cannot be applied to this part. It is where values are missing, with the last.
    """
    filed = work.loaded.job
    if source == MODEL and work.missing:
        job = replace(without_lobe(work.job), lobe_error_source=MODEL)
    elif source == MODEL:
        job = with_modelled_lobe(work.job, work.machine.machine)
    elif source == filed.lobe_error_source:
        job = with_lobe_of(work.job, filed)
    else:
        job = without_lobe(work.job)
    return _with_job(work, job, missing=work.missing)


def undone(work: Work) -> Work:
    """Return the work before its last edit."""
    if not work.undo:
        return work
    *earlier, (job, missing) = work.undo
    return replace(_with_job(work, job, missing=missing), undo=tuple(earlier))


def _with_job(work: Work, job: Job, *, missing: frozenset[str]) -> Work:
    """Return the work on another job; what is computed from it goes, and the strategy follows its lobe."""
    plain, strategy = UNCOMPENSATED.value, work.strategy
    if job.lobe_error_source == NO_LOBE:
        strategy = plain
    elif work.job.lobe_error_source == NO_LOBE and strategy == plain:
        strategy = DEFAULT_STRATEGY.value
    return replace(
        work,
        job=job,
        strategy=strategy,
        missing=missing,
        undo=(*work.undo, (work.job, work.missing)),
        outlook=None,
        preview=None,
        preview_problems=(),
    )


def with_strategy(work: Work, strategy: str) -> Work:
    """Return the work with another strategy to synchronise the tool with the spindle."""
    return replace(work, strategy=strategy)


def saved_as(work: Work, name: str, folder: Path) -> Work:
    """Save the job under another name in `folder`, created if missing, and return the work on that file.

    A copy takes over neither learned versions nor the sources of the values in the file. A new job is no copy.

    Raises:
        ProfileError: `file.exists`, `file.not_writable`, and the problems of the job; the work stays as it is.
    """
    path = folder / f"{name}.toml"
    make_folder(folder)
    job = replace(work.job, name=name) if work.is_new else copy_of(work.job, name, work.loaded.job.name)
    save_job(job, path, private=True)
    fresh = open_work(load_job(str(path)), work.machine)
    return replace(fresh, strategy=work.strategy, stage=work.stage, inverts=work.inverts)


def save_work(work: Work) -> Work:
    """Save the edited job over its own file, and return the work on that.

    What was learned of the job as it was no longer applies to it.

    Raises:
        ProfileError: `job.changed_elsewhere`, the file is not as it was opened; as `saved_as`.
    """
    path = work.loaded.path
    if differs(load_job(str(path)), work.loaded):
        raise ProfileError(Problem(code="job.changed_elsewhere", where=printable(str(path)), key=path.stem))
    save_job(work.job, path, overwrite=True)
    fresh = open_work(load_job(str(path)), work.machine)
    return replace(fresh, strategy=work.strategy, stage=work.stage, inverts=work.inverts)


def differs(now: LoadedJob, before: LoadedJob) -> bool:
    """Whether a job's file is not as it was: in what is cut, or in its note and tags."""
    return now.sha256 != before.sha256 or _labels(now.job) != _labels(before.job)


def relabel_work(work: Work, loaded: LoadedJob) -> Work:
    """Return the work after note and tags in its file were changed to those of `loaded`; the edits stay."""
    note, tags = _labels(loaded.job)
    undo = tuple((replace(job, note=note, tags=tags), missing) for job, missing in work.undo)
    return replace(work, loaded=loaded, job=replace(work.job, note=note, tags=tags), undo=undo)


def _labels(job: Job) -> tuple[str, tuple[str, ...]]:
    return job.note, job.tags


def entered_number(text: str, field_: Field) -> float | int | str:
    """Parse an entry; a text that is no number is returned unchanged, for the refusal to quote."""
    plain = plain_number(text, field_.key, field_.limit)
    if plain is None:
        return text
    try:
        return int(plain) if field_.kind is FieldType.WHOLE else float(plain)
    except ValueError:
        return text


def changed_since_opened(work: Work | None) -> tuple[Problem, ...]:
    """Return `job.changed_on_disk` where the file of a job is not as it was opened, such as after `git pull`.

    Of one that was edited on the screen it does not matter: that is what is cut. A file that is gone cannot be
    opened again: what was opened may be cut.
    """
    if work is None or work.edited:
        return ()
    loaded = work.loaded
    try:
        same = load_job(str(loaded.path)).sha256 == loaded.sha256
    except ProfileError:
        same = not loaded.path.exists()
    return () if same else (Problem(code="job.changed_on_disk", key=loaded.job.name, where=loaded.path.name),)
