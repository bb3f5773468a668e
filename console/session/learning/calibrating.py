"""The lobe of a job from the trace of a part that was cut without compensation; and keeping it in the job."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import MappingProxyType

from console.session.data.calibrations import Calibration, keep_job, store
from console.session.data.kept_files import utc_now
from console.session.errors import SessionError
from profiles.calibration.lobe import INDEX, FoundLobe, find_lobe, with_lobe
from profiles.calibration.plausible import ImplausibleStep, refuse_untyped, step_of
from profiles.files import printable
from profiles.job import Job
from profiles.lobe.lobe_conditions import CONDITIONS, NAMES
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedJob, load_job
from profiles.strict_values import rename_keys
from profiles.traces import Trace

LOBE_TAKEN = "lobe_taken"
"""Kind of the event in the run of a part whose lobe its job has taken."""

STATED = ("lobe_error_um_pp", "lobe_phase_deg", "lobe_past_jaw_deg", "lobe_error_source", *CONDITIONS, *NAMES)


@dataclass(frozen=True, slots=True, kw_only=True)
class PartLobe:
    """The lobe of a plain part, or why there is none.

    `loaded` is the file of its job, None for an edited one; `file` with its hash is the trace.
    """

    loaded: LoadedJob | None
    file: str
    file_sha256: str
    found: FoundLobe | None = None
    problems: tuple[Problem, ...] = ()

    @property
    def reasons(self) -> tuple[Problem, ...]:
        """Why the job cannot take it, empty if it can."""
        return self.problems if self.found is None else (*self.found.reasons, *self.problems)


def lobe_of(trace: Trace, job: Job, lobe: PartLobe, *, phase_known: bool, simulated: bool) -> PartLobe:
    """Return `lobe` with what one turn of its part shows; `job` has jaw 1 where it was found for the cut.

    Where the `phase_known`, the trace is at spindle angles. An objection does not invalidate the measurement.
    """
    edited = () if lobe.loaded is not None else (Problem(code="learned.edited_part", key=job.name),)
    if phase_known:
        placed = {"direction": "spindle", "start_mark": INDEX, "jaw_1_deg": f"{job.jaw_1_deg % 360.0:.6f}"}
        trace = replace(trace, meta=MappingProxyType({**trace.meta, **placed}))
    try:
        found = find_lobe(trace, job, practice=simulated)
    except ProfileError as error:
        return replace(lobe, problems=(*error.problems, *edited))
    return replace(lobe, found=found, problems=edited)


def accept_lobe(lobe: PartLobe, machine: MachineProfile, data: Path, typed: float | None = None) -> LoadedJob:
    """Keep the lobe of a part in its job, and the calibration beside it; return the job as it is on disk.

    Raises:
        SessionError: why it must not be kept.
        ProfileError: as `keep_lobe`.
    """
    if lobe.reasons or lobe.found is None or lobe.loaded is None:
        raise SessionError(*lobe.reasons)
    of_file = {"file": lobe.file, "file_sha256": lobe.file_sha256}
    return keep_lobe(lobe.loaded, lobe.found, machine, data, typed=typed, **of_file)[0]


def lobe_event(written: LoadedJob) -> dict[str, object]:
    """Return a lobe that a job has taken from a part, as the run record keeps it."""
    said = {key: getattr(written.job, key) for key in ("lobe_error_um_pp", "lobe_phase_deg", "lobe_past_jaw_deg")}
    return {**said, "job": written.job.name, "job_sha256": written.sha256}


def keep_lobe(
    loaded: LoadedJob,
    found: FoundLobe,
    machine: MachineProfile,
    data: Path,
    *,
    file: str,
    file_sha256: str,
    typed: float | None = None,
) -> tuple[LoadedJob, Path]:
    """Write the lobe into the job, and keep its calibration; return the job and the file of the calibration.

    `file` with its hash is the trace. A bundled job is copied.

    Raises ProfileError: `job.changed_elsewhere`, the file of the job has changed since; as `refuse_untyped`,
    `keep_job`, `store`.
    """
    refuse_untyped(lobe_step(loaded.job, found), typed, printable(file))
    if load_job(str(loaded.path)).sha256 != loaded.sha256:
        where, name = printable(str(loaded.path)), loaded.job.name
        raise ProfileError(Problem(code="job.changed_elsewhere", where=where, key=name))
    job = with_lobe(loaded.job, found, chuck=machine.chuck.name, tool=machine.tool.name)
    written = keep_job(data, loaded, job)
    said = {
        name: {key: getattr(each.job, key) for key in STATED}
        for name, each in (("job_before", loaded), ("job", written))
    }
    calibration = Calibration(
        kind="lobe",
        subject=loaded.job.name,
        subject_sha256=written.sha256,
        date=utc_now(),
        file=file,
        file_sha256=file_sha256,
        found={**lobe_record(found), **said, "job_before_sha256": loaded.sha256},
    )
    return written, store(data, calibration)


def lobe_step(job: Job, found: FoundLobe) -> ImplausibleStep | None:
    """Return the large step from the present lobe of a job, at its present force, to the fitted lobe."""
    at_force_um = job.lobe_error_um_pp * job.chucking_force_n / job.error_force_n
    return step_of("lobe_error_um_pp", found.fit.error_um_pp, (at_force_um,))


def lobe_record(found: FoundLobe) -> dict[str, object]:
    """Return the numbers of a fit by name, as files and `--json` have them."""
    fit, seen = found.fit, found.diagnosis
    return {
        "error_um_pp": fit.error_um_pp,
        "error_ci_um_pp": 2 * fit.lobe.ci_um,
        "crest_deg": found.phase_deg,
        "past_jaw_deg": found.past_jaw_deg,
        "crest_ci_deg": fit.lobe.ci_deg,
        "simulated": found.simulated,
        "high_at_jaws": seen and seen.high_at_jaws,
        "mechanism": seen and seen.mechanism,
        **rename_keys(asdict(fit), {"phase_deg": "crest_deg"}),
        "floor_um": fit.floor_um,
        "bias_um": fit.lobe.bias_um,
    }
