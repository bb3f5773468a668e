"""The record of a cut: what it rests on, written as it is armed."""

from __future__ import annotations

from console.session.cut.simulated_parts import LatheParts, lathe_setup
from console.session.data.calibrated_chuck import calibrations_of
from console.session.data.made_parts import MODEL, MadeWith
from console.session.data.records import RunFacts, begin_record
from console.session.stages import Stage
from console.session.station.commands import Arm
from console.session.station.context import StationContext
from drivers.cutting.planning import CutPlan
from profiles.fingerprint.readings import readings_text
from profiles.store import job_text


def open_record(context: StationContext, command: Arm, plan: CutPlan, made: MadeWith) -> None:
    """Open the record of the cut that has been armed, and end the one before."""
    context.end_record()
    job, machine, jaw = command.job, context.loaded_machine, context.state.alignment.jaw
    touched, simulated = context.state.alignment.touch_off, context.cut_context.simulated
    facts = _facts(context, command)
    context.open_record(begin_record(context.records, facts, machine, plan, simulated=simulated))
    context.log_command(command)
    context.note(
        "armed",
        force_n=job.chucking_force_n,
        jaw_1_deg=None if jaw is None else jaw.angle_deg,
        zero_radius_mm=None if touched is None else touched.zero_radius_mm,
        calibrations=calibrations_of(machine),
        **made.event(),
    )


def _lathe(context: StationContext) -> dict[str, object]:
    """Return which simulated lathe it is, and which part of it is in the chuck where they differ."""
    shop = context.shop
    if shop is None:
        return {}
    parts = LatheParts(lathe=shop.which, part=shop.parts) if shop.parts_differ else None
    return lathe_setup(shop.which, parts)


def _facts(context: StationContext, command: Arm) -> RunFacts:
    """Return what the run rests on: the job as it is cut, and the alignment, with the times of its stamps."""
    job, loaded, alignment = command.job, command.loaded, context.state.alignment
    clamping, jaw, touched = alignment.clamping, alignment.jaw, alignment.touch_off
    learned = command.compensation
    return RunFacts(
        job=job,
        job_sha256=command.job_sha256,
        job_text=loaded.text if loaded is not None and loaded.job == job and loaded.text else job_text(job),
        stage=Stage(command.stage).value,
        compensation=None if learned is None else learned.version,
        controller=context.state.controller or None,
        job_path=None if loaded is None else loaded.path,
        setup={
            "force_n": job.chucking_force_n,
            "clamped_at": None if clamping is None else clamping.at,
            "jaw_1_deg": None if jaw is None else jaw.angle_deg,
            "jaw_1_at": None if jaw is None else jaw.at,
            "zero_radius_mm": None if touched is None else touched.zero_radius_mm,
            "touch_off_at": None if touched is None else touched.at,
            "aligned": True,
            "calibrations": calibrations_of(context.loaded_machine),
            "inverted": MODEL if command.inverts is None else command.inverts.name,
            "indicated": None if alignment.readings is None else readings_text(alignment.readings),
            "address": context.state.address,
            **_lathe(context),
        },
    )
