"""Apply gains on trial and take them back: one transaction, on disk before the first write, judged by reading.

What stands in the controller decides, never what was sent: after any end the gains are read again, and so they are
by the next console, after a restart or a lost link. Nothing is saved in the controller (SAVE).
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.errors import SessionError, refuse
from console.session.tuning import record as records
from console.session.tuning.air_proof import find_missing_proofs
from console.session.tuning.bounds import bound_problems, filter_problems, margins_with
from console.session.tuning.known_loop import KnownLoop, known_loop
from console.session.tuning.record import TrialRecord, ended_by, open_trial, plant_of, values_of
from console.session.tuning.standing_trial import Gains, StandingTrial, format_gains, stands_problem
from drivers.commissioning.gains import refuse_unready
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.identification.tool_gains import ToolGains, ToolLoop, matches
from drivers.link.address import without_options
from drivers.pmac.client import PmacClient
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo_gains import with_variables
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError, ProfileError


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialPlace:
    """One machine whose gains are tried: its controller, its profile, and the data folder."""

    client: PmacClient
    machine: MachineProfile
    data: Path
    simulated: bool
    firmware: tuple[str, str] = ("", "")

    @property
    def gains(self) -> ToolGains:
        """The gains of the tool in the controller."""
        return ToolGains(self.client, self.machine.tool.motor)

    @property
    def address(self) -> str:
        """The address of the controller, without options."""
        return without_options(self.client.link.address)

    def trial(self) -> tuple[Path, TrialRecord] | None:
        """Return the trial of this machine that is not over; ProfileError `trial.file`: it cannot be read."""
        found = open_trial(self.data, self.machine.name, self.address, simulated=self.simulated)
        if found is not None:
            found = found[0], found[1].complete(self.gains.names)
        if found is not None and tuple(found[1].before) != self.gains.names:
            where, value = str(found[0]), ", ".join(found[1].before)
            raise ProfileError(Problem(code="trial.file", where=where, value=value))
        return found


def standing_trial(place: TrialPlace, *, settle: bool) -> StandingTrial | None:
    """Return the trial that stands in the controller, by reading its gains; nothing is written to it.

    With `settle` one that has ended by itself is closed on disk: the old gains are back (power-up, another host),
    those of the machine profile are there (`controller apply`), or it has the new ones, proven in air.
    Raises ProfileError: a file; DriverError: the link broke.
    """
    kept = place.trial()
    if kept is None:
        return None
    file, trial = kept
    found = place.gains.read()
    ended = ended_by(place.machine, trial, found)
    if ended == records.ADOPTED and (doubts := air_doubts(place, trial, found)):
        standing = _standing(place, trial, found)
        return replace(standing, problems=doubts) if standing.whole else standing
    if ended:
        if settle:
            records.write_again(file, trial.add_event(ended, found, over=True))
        return None
    return _standing(place, trial, found)


def air_doubts(place: TrialPlace, trial: TrialRecord, found: Mapping[str, float]) -> tuple[Problem, ...]:
    """Return why the gains that stand are not proven in air, on the axis that they were bounded by."""
    loop = loop_of(with_variables(place.machine, found), plant_of(trial.axis))
    return find_missing_proofs(place.data, place.machine, found, loop, simulated=place.simulated)


def _standing(place: TrialPlace, trial: TrialRecord, found: Mapping[str, float]) -> StandingTrial:
    before, proposed, now = _pairs(trial.before), _pairs(trial.proposed), _pairs(found)
    whole = matches(found, trial.proposed)
    problems: tuple[Problem, ...] = (_active(trial),) if whole else (stands_problem(before, proposed, now),)
    if whole:
        read = place.gains.loop("")
        # The axis that it was bounded by: to fit it anew takes longer than the link thread may.
        known = KnownLoop(loop=loop_of(read.apply_to(place.machine), plant_of(trial.axis)))
        if bounds := bound_problems(place.machine, read, trial.proposed, known):
            whole, problems = False, (*bounds, stands_problem(before, proposed, now))
    began = trial.events[0] if trial.events else None
    return StandingTrial(
        date="" if began is None else began.date,
        by="" if began is None else began.by,
        before=before,
        proposed=proposed,
        found=now,
        whole=whole,
        problems=problems,
    )


def _active(trial: TrialRecord) -> Problem:
    return Problem(
        code="trial.active", value=format_gains(_pairs(trial.proposed)), limit=format_gains(_pairs(trial.before))
    )


def apply_trial(place: TrialPlace, settings: Mapping[str, float], shown: Mapping[str, float]) -> None:
    """Write gains, drives disabled, once what stands now is on disk; `shown` is what the operator saw as present.

    An open trial continues: what there was before it stays what a revert restores.

    Raises:
        RefusedError: `controller.drives_on`, `controller.program_running`; SessionError: `trial.*`, the controller
            or the margins forbid it; ProfileError: nothing could be written to disk. Nothing was written.
        SessionError: the cause, and `trial.stands`: what stands in the controller now.
        LinkError: the link broke; the trial is open on disk, and judged when the controller answers again.
    """
    refuse_unready(place.client, place.client.dialect)
    read, found = place.gains.loop(""), place.gains.read()
    if not matches(found, shown):
        present, before = format_gains(_pairs(found)), format_gains(_pairs(shown))
        raise SessionError(Problem(code="trial.changed_meanwhile", value=present, limit=before))
    if tuple(settings) != place.gains.names:
        value, limit = ", ".join(settings), ", ".join(place.gains.names)
        raise SessionError(Problem(code="trial.range", key="Ix30..Ix39", value=value, limit=limit))
    known = known_loop(read.apply_to(place.machine), place.data, place.firmware, simulated=place.simulated)
    refuse(bound_problems(place.machine, read, settings, known))
    refuse(filter_problems(place.machine, read, settings, known))
    file, trial = _begin_trial(place, read, found, settings, known)
    _write(place, file, trial, settings, records.APPLIED)


def revert_trial(place: TrialPlace) -> None:
    """Write back the gains there were before the trial, drives disabled. Raises as `apply_trial`; `trial.none`."""
    kept = place.trial()
    if kept is None:
        raise SessionError(Problem(code="trial.none", key=place.machine.name))
    refuse_unready(place.client, place.client.dialect)
    file, trial = kept
    trial = trial.add_event(records.REVERTING, place.gains.read())
    records.write_again(file, trial)
    _write(place, file, trial, trial.before, records.REVERTED)


def _begin_trial(
    place: TrialPlace, read: ToolLoop, found: Mapping[str, float], settings: Mapping[str, float], known: KnownLoop
) -> tuple[Path, TrialRecord]:
    """Keep what stands now, before anything is written."""
    proposed = {name: float(value) for name, value in settings.items()}
    kept, data, name = place.trial(), place.data, place.machine.name
    before = found if kept is None else kept[1].before
    version, kind = place.firmware
    margins = margins_with(place.machine, read, proposed, known)
    trial = TrialRecord(
        machine=name,
        simulated=place.simulated,
        address=place.address,
        version=version,
        kind=kind,
        before=before,
        proposed=proposed,
        axis=values_of(known.loop.plant),
        margins={
            "gain_margin": margins.gain_margin or 0.0,
            "phase_margin_deg": margins.phase_margin_deg or 0.0,
            "sensitivity_peak": margins.sensitivity_peak,
        },
        open=True,
        events=() if kept is None else kept[1].events,
    ).add_event(records.BEGUN, found)
    if kept is not None:
        records.write_again(kept[0], trial)
        return kept[0], trial
    file = records.file_of_new(data, name)
    records.write_new(file, trial)
    return file, trial


def _write(place: TrialPlace, file: Path, trial: TrialRecord, values: Mapping[str, float], done: str) -> None:
    try:
        place.gains.write(values)
    except LinkError:
        with suppress(ProfileError):  # both sets are on disk already, and what stands will be read
            records.write_again(file, trial.add_event(records.ENDED_EARLY, {}))
        raise
    except (DriverError, RefusedError) as error:
        found = place.gains.read()
        with suppress(ProfileError):
            records.write_again(file, trial.add_event(records.ENDED_EARLY, found))
        stands = stands_problem(_pairs(trial.before), _pairs(trial.proposed), _pairs(found))
        raise SessionError(*error.problems, stands) from error
    records.write_again(file, trial.add_event(done, values, over=done == records.REVERTED))


def _pairs(gains: Mapping[str, float]) -> Gains:
    return tuple(gains.items())


def safe_trial(place: TrialPlace, *, settle: bool) -> tuple[StandingTrial | None, tuple[Problem, ...]]:
    """Return the standing trial, and why its file cannot be used; a DriverError is raised as it is."""
    try:
        return standing_trial(place, settle=settle), ()
    except DriverError:
        raise
    except ProblemError as error:
        return None, tuple(error.problems)
