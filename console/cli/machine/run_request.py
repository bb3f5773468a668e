"""Request of `console run`: a job on a machine at a place, planned, with nothing sent yet."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass, replace
from pathlib import Path

from console.cli.arguments import DEFAULT_PLANT, INDICATOR
from console.cli.library import (
    along_as_there,
    data_of,
    job_of,
    known_gauge_of,
    known_lathe,
    lathe_parts_of,
    machine_of,
    true_parameters_of,
)
from console.cli.measured.fingerprint_source import requested_fingerprint
from console.session.cut.run import RunPlan, plan_run
from console.session.cut.simulated_parts import LatheParts
from console.session.data.calibrated_chuck import CalibratedMachine, apply_calibrations
from console.session.data.identified_responses import asked_response
from console.session.data.learned_store import (
    NONE,
    asked_for,
    choose_version,
    date_problems,
    find_newest_version,
    lathe_problems,
    versions,
)
from console.session.data.measured_part import newest_part
from console.session.errors import SessionError
from console.session.learning.fingerprint import FingerprintedCut
from console.session.learning.gauge_errors import error_told, spindle_told
from console.session.learning.learning import COMPARED, refuse_unlearnable, refuse_untrimmed
from console.session.learning.learning_steps import check_of
from console.session.stages import Stage, nominal_path
from console.session.station.machine_address import address_of
from drivers.cutting.strategy import Strategy
from drivers.lathe.heartbeat import cut_condition
from drivers.link.address import LinkAddress, SimulatedAddress
from drivers.simulator.plant.true_parameters import TrueParameters
from drivers.simulator.plant.which_lathe import IDEAL, WhichLathe
from profiles.axis.response import ServoResponse
from profiles.compensations.learned_compensation import (
    OTHER_SETTINGS,
    HoldsFor,
    LearnedCompensation,
    differences,
    history_of,
)
from profiles.compensations.path import CutPath
from profiles.files import printable
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.metrology.uncertainty import KnownGauge
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedJob, LoadedMachine


@dataclass(frozen=True, kw_only=True)
class RunRequest:
    """`address` is None for a simulated machine in this process, which runs as fast as it is computed.

    `true` is the actual plant of that one, None for one as its profile says. `parts` is the length of a learning
    series, each part of it `felt` by an indicator or not, and `banded`, with a trial band, or not. `part_file` is
    the file for the trace of the part. `fingerprint` is what an indicator has shown of the clamping of a single
    part. `warnings` are reported before anything moves, among them what was learned and is not used in this cut.
    `lathe_parts` are those of the simulated lathe that it cuts, None if all of its parts are alike. `gauge` is
    what its parts are measured on, None if it is not stated.
    """

    job: LoadedJob
    machine: CalibratedMachine
    plan: RunPlan
    address: LinkAddress | None
    simulated: bool
    true: TrueParameters | None
    parts: int | None
    part_file: Path | None
    warnings: tuple[Problem, ...]
    fingerprint: FingerprintedCut | None = None
    felt: bool = False
    banded: bool = False
    lathe_parts: LatheParts | None = None
    gauge: KnownGauge | None = None

    @property
    def which(self) -> WhichLathe | None:
        """The simulated lathe in this process, None for a machine at an address."""
        if self.address is not None:
            return None
        return WhichLathe(plant=IDEAL, seed=0, alike=True) if self.true is None else self.true.lathe


def plan_request(options: Namespace) -> RunRequest:
    """Load and plan what the command line requests; nothing is opened."""
    if options.learn is not None:
        refuse_untrimmed(Strategy(options.strategy))
    elif options.trial_band:
        raise SessionError(Problem(code="band.alone", key="--trial-band", limit="--learn"))
    job, loaded = job_of(options), apply_calibrations(machine_of(options), data_of(options))
    address, true, lathe = _place(options, loaded.machine)
    loaded = along_as_there(loaded, address, true)
    machine = loaded.machine
    simulated = address is None or isinstance(address, SimulatedAddress)
    asked = asked_for(job, loaded, options.strategy, simulated=simulated, lathe=lathe)
    known = () if options.compensation == NONE else versions(data_of(options), asked)
    learned = choose_version(options.compensation, known, asked)
    path, inverted = _path(options, job.job, machine, learned, simulated=simulated)
    lathe_parts = _lathe_parts(options, job.job, machine, true) if address is None else None
    true = true if true is None or lathe_parts is None else replace(true, parts_before=lathe_parts.part - 1)
    history = history_of(learned, known)
    fingerprint = _fingerprint(options, job.job, machine, path, inverted, history, true, simulated=simulated)
    path = path if fingerprint is None else fingerprint.path
    plan = plan_run(
        job.job,
        machine,
        Strategy(options.strategy),
        options.ts,
        str(job.path),
        watchdog=cut_condition(machine),
        stage=Stage(options.stage),
        path=path,
        inverted="" if inverted is None else inverted.name,
        compensation=None if learned is None else learned.version,
        simulated=simulated,
        fingerprint="" if fingerprint is None else fingerprint.made,
    )
    _refuse_beside_learning(options, plan, measured=address is None)
    gauge = known_gauge_of(options, lathe)
    return RunRequest(
        job=job,
        machine=loaded,
        plan=plan,
        address=address,
        simulated=simulated,
        true=true,
        parts=options.learn,
        part_file=_part_file(options, simulated=simulated),
        warnings=(
            *loaded.warnings,
            *_of_versions(options, job, loaded, learned, asked),
            *plan.warnings,
            *(() if gauge is None or address is not None else error_told(gauge.error)),
            *(spindle_told(gauge) if options.learn else ()),
            *(() if fingerprint is None else fingerprint.clamped.warnings),
        ),
        fingerprint=fingerprint,
        felt=options.fingerprint is not None,
        banded=options.trial_band,
        lathe_parts=lathe_parts,
        gauge=gauge,
    )


def _place(options: Namespace, machine: MachineProfile) -> tuple[LinkAddress | None, TrueParameters | None, str]:
    """Return where the part is cut: at an address, or on a plant in this process; and on which simulated lathe."""
    if not options.sim:
        address, lathe = known_lathe(address_of(machine, options.link, simulated=False), machine)
        return address, None, lathe
    true = true_parameters_of(options, machine)
    return None, true, DEFAULT_PLANT if true is None else str(true.lathe)


def _lathe_parts(
    options: Namespace, job: Job, machine: MachineProfile, true: TrueParameters | None
) -> LatheParts | None:
    """Return which parts of the lathe are cut: none in air, and in a row two to compare with, too."""
    parts = 0 if options.stage == Stage.AIR else 1
    return lathe_parts_of(
        options, job.name, machine.name, true, parts if options.learn is None else options.learn + COMPARED
    )


def _of_versions(
    options: Namespace,
    job: LoadedJob,
    machine: LoadedMachine,
    learned: LearnedCompensation | None,
    asked: HoldsFor,
) -> tuple[Problem, ...]:
    """Return the warnings about the learned version of this cut, or about those that it leaves unused."""
    return (
        *date_problems(learned),
        *lathe_problems(learned, asked),
        *_find_unused_version(options, job, machine, asked),
        *_find_contradicted_stage(options, job, machine, simulated=asked.simulated),
    )


def _find_unused_version(
    options: Namespace, job: LoadedJob, machine: LoadedMachine, asked: HoldsFor
) -> tuple[Problem, ...]:
    """Return the notice that a learned version is not used; a learning series begins from the job."""
    if options.compensation != NONE or options.learn is not None or not Strategy(options.strategy).traits.inverts:
        return ()
    try:
        newest = find_newest_version(job, machine, data_of(options), simulated=asked.simulated)
    except ProblemError as error:
        return tuple(error.problems)  # a cut without learned versions does not need them
    if newest is None or newest.is_model:
        return ()
    strategy = newest.holds_for.strategy
    if found := differences(newest, replace(asked, strategy=strategy)):
        return tuple(each for each in found if each.code == OTHER_SETTINGS)
    return (Problem(code="learned.not_used", key=str(newest.version), value=strategy),)


def _find_contradicted_stage(
    options: Namespace, job: LoadedJob, machine: LoadedMachine, *, simulated: bool
) -> tuple[Problem, ...]:
    """Return the warning of a full stage that the force of the last part, a half-stage one, contradicts."""
    if options.stage != Stage.FULL or options.learn is not None or not Strategy(options.strategy).traits.inverts:
        return ()
    try:
        part = newest_part(data_of(options), asked_for(job, machine, "", simulated=simulated))
        check = check_of(part, job.job)
    except ProblemError as error:
        return tuple(error.problems)
    found = None if check is None else check.contradicts(job.job)
    return () if found is None else (found,)


def _path(
    options: Namespace, job: Job, machine: MachineProfile, learned: LearnedCompensation | None, *, simulated: bool
) -> tuple[CutPath | None, ServoResponse | None]:
    """Return the learned path, or the inverse of the identified response with that; None for the model's."""
    if options.identified is None:
        return None if learned is None else learned.path, None
    strategy = Strategy(options.strategy)
    data, asked = data_of(options), options.identified
    response = asked_response(data, asked, machine, strategy, simulated=simulated).response
    if learned is not None:
        raise SessionError(Problem(code="run.two_inverses", key="--compensation", value="--identified"))
    return nominal_path(job, machine, strategy, response), response


def _fingerprint(
    options: Namespace,
    job: Job,
    machine: MachineProfile,
    path: CutPath | None,
    inverted: ServoResponse | None,
    history: tuple[LearnedCompensation, ...],
    true: TrueParameters | None,
    *,
    simulated: bool,
) -> FingerprintedCut | None:
    """Return the fingerprint that a single cut was asked for with, None if it was not."""
    if options.fingerprint is None or options.learn is not None:
        return None
    return requested_fingerprint(
        options.fingerprint,
        job,
        machine,
        Strategy(options.strategy),
        in_process=bool(options.sim),
        simulated=simulated,
        stage=Stage(options.stage),
        true=true,
        path=path,
        inverted=inverted,
        history=history,
    )


def _part_file(options: Namespace, *, simulated: bool) -> Path | None:
    """Return the file for the trace of the part; refuse it now rather than after the cut."""
    if options.part is None:
        return None
    if not simulated or options.stage == Stage.AIR:
        raise SessionError(Problem(code="run.no_part", key="--part", value=options.part))
    path = Path(options.part)
    if path.exists():
        raise SessionError(Problem(code="file.exists", where=printable(options.part)))
    return path


def _refuse_beside_learning(options: Namespace, plan: RunPlan, *, measured: bool) -> None:
    """Refuse options that a learning series sets by itself, and a cut from which nothing can be learned."""
    if options.learn is None:
        return
    given = {
        "--compensation": options.compensation != NONE,
        "--stage": options.stage != Stage.FULL,
        "--part": options.part is not None,
        "--identified": options.identified is not None,
        "--fingerprint FILE": options.fingerprint not in (None, INDICATOR),
    }
    if value := ", ".join(option for option, there in given.items() if there):
        raise SessionError(Problem(code="learning.alone", key="--learn", value=value))
    refuse_unlearnable(plan, measured=measured)
