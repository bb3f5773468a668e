"""Command handlers, one function per command. All of them run in the link thread.

A refusal is a `SessionError` and leaves the machine alone; on any other error the station stops the machine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from console.session.cut.alignment import clamp_blank, force_problems, table_problems
from console.session.cut.engine import tool_clear
from console.session.cut.interlocks import of_drives, of_job
from console.session.cut.retracting import refuse_unless_still
from console.session.data import health, identified_responses
from console.session.data.kept_files import utc_now
from console.session.errors import SessionError, refuse, require
from console.session.station import commands, jogging, readings
from console.session.station.alarms import NOBODYS, OUSTED, recover_alarms
from console.session.station.context import StationContext
from console.session.station.cutting import arm, clear_left_tables, disarm, retract, start
from console.session.station.durations import approach_s, home_s, jog_s
from console.session.station.gain_trial import apply_gains, revert_gains, trial_problems, verify_controller
from console.session.station.measuring import correct_touch_off, measure_simulated, measure_turned, take_trace
from console.session.station.state import Activity, SessionStart
from console.session.station.targets import GO_TO, distance_to, target_problems
from drivers.errors import ControllerError
from drivers.identification.health import HealthRequest, check_health
from drivers.identification.identify import identify, origin_of
from drivers.identification.request import IdentificationRequest
from drivers.identification.result import ResponseOrigin
from drivers.identification.rig import Rig
from drivers.identification.tool_gains import read_tool_loop
from drivers.lathe.safety import safety_problems
from drivers.lathe.snapshot import AxisName
from drivers.pmac.client import PmacClient
from drivers.pmac.programs.setup import cut_setup
from profiles.problem import Problem, ProfileError

OWNER_CODES = ("owner.held", "owner.beside", OUSTED, *NOBODYS, "owner.observer", "owner.free")
"""Alarms that taking control settles."""

OVER_PART_MM = 2.0  # distance of the tool behind the face of the part for the touch-off


def verify(context: StationContext, _: commands.Verify) -> None:
    """Compare the controller with its profile; its owner also reads what tables would add to the tool.

    A table that is on does not keep the drives off: they retract the tool, and only then it is switched off.
    """
    if context.state.controls:
        context.lathe.program.put_back()
    settings = verify_controller(context)
    tables: tuple[Problem, ...] = ()
    if context.state.controls:
        tables = context.lathe.program.tables_left()
        if context.commissioned is not None:
            context.commissioned.take_fingerprint()
        lasting = () if context.commissioned is None else context.commissioned.lasting_problems()
        context.tell(uncommissioned=(*trial_problems(context), *lasting))
    context.tell(alignment=replace(context.state.alignment, settings=settings, tables=tables))


def take_control(context: StationContext, command: commands.TakeControl) -> None:
    """Take control of the machine, whoever had it. An alignment made from another console is not known here."""
    context.owning.take_control()
    if not context.lathe.snapshot().loops_open:
        context.lathe.confirm_nobody_inside()  # whoever had control has enabled the drives since
    context.tell_standing()
    context.tell(lost_link=None)
    context.end_alarms(*OWNER_CODES)
    verify(context, commands.Verify())


def confirm_clamping(context: StationContext, command: commands.ConfirmClamping) -> None:
    """Record the operator's confirmation that the blank is clamped; in the simulator, clamp it."""
    require(context.lathe.snapshot().loops_open, "alignment.drives_on")
    refuse(table_problems(context.state.alignment))
    refuse_unless_still(context.lathe, context.clock)
    in_part = jogging.tool_in_part(
        context.lathe.snapshot(), context.loaded_machine.machine, context.state.alignment
    )
    require(not in_part, "machine.tool_in_part")
    refuse(of_job(command.job, context.machine).problems)
    refuse(force_problems(command.job))
    if context.shop is not None:
        context.shop.mount(command.job)
    alignment = clamp_blank(context.state.alignment, command.job, context.local_time())
    context.tell(
        alignment=alignment, cut=None, cut_done=False, touched=None, marks_mm=(), measured=None, form=None
    )
    context.tell(indicated=None)


def ask_truth(context: StationContext, _: commands.AskTruth) -> None:
    """Ask the simulated lathe for its true state; `session.not_simulated`."""
    if context.shop is None:
        raise SessionError(Problem(code="session.not_simulated"))
    context.tell(truth=context.shop.truth())


def switch_on(context: StationContext, _: commands.EnableDrives) -> None:
    """Enable the drives, on a controller that is set as its profile says."""
    settings = context.state.alignment.settings
    require(settings is not None, "alignment.not_verified")
    refuse(settings or ())
    refuse_unless_still(context.lathe, context.clock)
    context.lathe.confirm_nobody_inside()
    try:
        context.lathe.enable()
    except ControllerError as refused:
        # One axis may have closed before another was refused: all or none.
        context.lathe.switch_off()
        raise SessionError(*refused.problems) from refused


def begin_as(context: StationContext, begins: SessionStart) -> None:
    """Take over the stamps with which a session begins, and enable the drives where they were enabled."""
    if context.shop is None:
        raise SessionError(Problem(code="session.not_simulated"))
    stamps = {name: getattr(begins.alignment, name) for name in ("clamping", "jaw", "touch_off")}
    context.tell(alignment=replace(context.state.alignment, **stamps))
    if begins.drives_on:
        switch_on(context, commands.EnableDrives())


def switch_off(context: StationContext, _: commands.DisableDrives) -> None:
    """Disable the drives."""
    context.lathe.switch_off()
    context.lathe.program.put_back()


def home(context: StationContext, _: commands.Home) -> None:
    """Home all axes."""
    refuse(of_drives(context.lathe.snapshot()).problems)
    refuse(table_problems(context.state.alignment))
    ends_s = home_s(context.machine, context.lathe.snapshot())
    latest_s = None if ends_s is None else context.clock.now_s() + ends_s
    context.tell(ends_s=latest_s, ends_at_most=not context.lathe.snapshot().homed)
    context.lathe.refuse_other_jog(*context.lathe.driven)
    context.lathe.home()


def approach(context: StationContext, command: commands.Approach) -> None:
    """Move the tool out, the carriage over the part, and the tool in to the retract distance."""
    context.refuse_unless_homed()
    machine = context.machine
    setup = cut_setup(command.job, machine)
    over_mm = min(OVER_PART_MM, 0.5 * command.job.cut_length_mm)
    face = (machine.carriage.jaw_face_mm - command.job.overhang_mm) * machine.carriage.counts_per_mm
    lathe, over = context.lathe, face + over_mm * machine.carriage.counts_per_mm
    within_s = approach_s(machine, lathe.snapshot(), over, setup.retracted)
    context.tell(ends_s=context.clock.now_s() + within_s)
    if lathe.snapshot().tool.position > setup.retracted:
        lathe.retract(setup.retracted)
    lathe.refuse_other_jog(AxisName.CARRIAGE, AxisName.TOOL)
    lathe.jog_to(AxisName.CARRIAGE, over)
    lathe.jog_to(AxisName.TOOL, setup.retracted, settle=False)


def jog(context: StationContext, command: commands.Jog) -> None:
    """Jog one step; toward the work no further than to the clamped part, as far as that is known."""
    context.refuse_unless_homed()
    if command.axis is AxisName.TOOL:
        nominal, alignment = context.loaded_machine.machine, context.state.alignment
        toward = jogging.step_problem(command.distance, context.lathe.snapshot(), nominal, alignment)
        refuse(() if toward is None else (toward,))
    too_fast = jogging.speed_problem(context.machine, command.axis, command.distance)
    refuse(() if too_fast is None else (too_fast,))
    _jog_by(context, command.axis, command.distance)


def go_to(context: StationContext, command: commands.GoTo) -> None:
    """Go to a target with one jog, if nothing is in the way; the carriage or the spindle."""
    context.refuse_unless_homed()
    require(command.axis in GO_TO, "machine.no_target_axis")
    snapshot, machine = context.lathe.snapshot(), context.loaded_machine.machine
    refuse(target_problems(snapshot, machine, context.state.alignment, command.axis, command.target))
    _jog_by(context, command.axis, distance_to(snapshot, machine, command.axis, command.target))


def _jog_by(context: StationContext, axis: AxisName, distance: float) -> None:
    """Jog, and count it once it is in position."""
    context.tell(ends_s=context.clock.now_s() + jog_s(context.machine, axis, distance))
    context.lathe.refuse_other_jog(axis)
    context.lathe.jog_by(axis, distance * jogging.counts_per_unit(context.machine, axis))
    context.tell(jogs=context.state.jogs + 1)


def recover(context: StationContext, _: commands.Recover) -> None:
    """Reset after a stop; nothing moves, and the interrupted motion is not resumed.

    A cut by a table that was stopped has left it on.
    """
    context.lathe.stop.release()
    if context.state.controls:
        context.lathe.acknowledge_loss()
        if context.started is not None and context.started.plan.program.tables:
            tables = context.lathe.program.tables_left()
            context.tell(alignment=replace(context.state.alignment, tables=tables))
    context.change_alarms(recover_alarms)
    context.tell(stop=None, armed=None, lost_link=None)
    context.limits_seen = context.lathe.snapshot().limits


def measure(context: StationContext, _: commands.Measure) -> None:
    """Disable the drives, open the chuck, and measure the part on the gauge."""
    if context.shop is None:
        raise SessionError(Problem(code="session.no_gauge"))
    plan = context.plan
    if plan is None or context.started is None or not context.state.cut_done:
        raise SessionError(Problem(code="session.nothing_cut"))
    snapshot = context.lathe.snapshot()
    require(snapshot.at_rest, "machine.moving")
    require(tool_clear(snapshot, plan), "machine.tool_in_part")
    if not snapshot.loops_open:
        context.lathe.switch_off()
    refuse_unless_still(context.lathe, context.clock)
    measure_simulated(context)


def read_loop(context: StationContext, _: commands.ReadLoop) -> None:
    """Read gains and servo period of the tool. Nothing moves, nothing is written."""
    client = _client(context)
    motor = context.loaded_machine.machine.tool.motor
    context.tell(tool_loop=read_tool_loop(client, client.dialect, motor, context.local_time()))


def check_tool(context: StationContext, command: commands.CheckHealth) -> None:
    """Test the tool at its zero, and keep the result."""
    request = HealthRequest(step_um=command.step_um)

    def work(rig: Rig, origin: ResponseOrigin) -> Path:
        return health.store(context.records, check_health(rig, request, origin, utc_now()))

    _run_tests(context, work)


def identify_tool(context: StationContext, command: commands.IdentifyTool) -> None:
    """Identify the tool on one path, and keep its response."""
    request = IdentificationRequest(path=command.path)

    def work(rig: Rig, origin: ResponseOrigin) -> Path:
        return identified_responses.store(context.records, identify(rig, request, origin, utc_now()))

    _run_tests(context, work)


def _run_tests(context: StationContext, work: Callable[[Rig, ResponseOrigin], Path]) -> None:
    """Refuse what must not be, work, and tell the file."""
    client, lathe = _client(context), context.lathe
    snapshot, machine = lathe.snapshot(), context.loaded_machine.machine
    if not context.state.simulated:
        refuse(safety_problems(machine, snapshot.inputs))
    if jogging.tool_in_part(snapshot, machine, context.state.alignment):
        raise SessionError(Problem(code="machine.tool_in_part"))
    _load_numerics()
    rig, (version, kind) = Rig(client=client, lathe=lathe, clock=context.clock), context.state.firmware
    with _profile_errors_refuse():
        origin = origin_of(rig, version=version, kind=kind, simulated=context.state.simulated)
        context.tell(tested=work(rig, origin).name)


@contextmanager
def _profile_errors_refuse() -> Iterator[None]:
    """Data that cannot be evaluated or kept are no reason to stop: where the tool moved it has been stopped."""
    try:
        yield
    except ProfileError as error:
        raise SessionError(*error.problems) from error


def _load_numerics() -> None:
    """Load what evaluates the samples while nothing moves yet: its import holds up this thread."""
    import scipy.signal
    import scipy.stats  # noqa: F401


def _client(context: StationContext) -> PmacClient:
    if context.client is None:
        raise SessionError(Problem(code="session.lost"))
    return context.client


HANDLERS: dict[type[Any], tuple[Activity, Callable[[StationContext, Any], None]]] = {
    commands.Verify: (Activity.VERIFYING, verify),
    commands.ConfirmClamping: (Activity.CLAMPING, confirm_clamping),
    commands.EnableDrives: (Activity.SWITCHING, switch_on),
    commands.DisableDrives: (Activity.SWITCHING, switch_off),
    commands.Home: (Activity.HOMING, home),
    commands.Approach: (Activity.APPROACHING, approach),
    commands.Jog: (Activity.JOGGING, jog),
    commands.GoTo: (Activity.JOGGING, go_to),
    commands.TakeFlank: (Activity.READY, readings.take_flank),
    commands.TakeJaw: (Activity.READY, readings.take_jaw),
    commands.NoteSkim: (Activity.READY, readings.note_skim),
    commands.TakeTouchOff: (Activity.READY, readings.take_touch_off),
    commands.Forget: (Activity.READY, readings.forget),
    commands.Indicate: (Activity.READY, readings.indicate),
    commands.TakeFingerprint: (Activity.READY, readings.take_fingerprint),
    commands.ReadLoop: (Activity.VERIFYING, read_loop),
    commands.ApplyGains: (Activity.WRITING, apply_gains),
    commands.RevertGains: (Activity.WRITING, revert_gains),
    commands.CheckHealth: (Activity.TESTING, check_tool),
    commands.IdentifyTool: (Activity.TESTING, identify_tool),
    commands.Arm: (Activity.ARMING, arm),
    commands.Disarm: (Activity.READY, disarm),
    commands.Start: (Activity.POSITIONING, start),
    commands.Retract: (Activity.RETRACTING, retract),
    commands.ClearTables: (Activity.WRITING, clear_left_tables),
    commands.Recover: (Activity.STOPPED, recover),
    commands.TakeControl: (Activity.VERIFYING, take_control),
    commands.Measure: (Activity.MEASURING, measure),
    commands.MeasureTurned: (Activity.MEASURING, measure_turned),
    commands.TakeTrace: (Activity.MEASURING, take_trace),
    commands.CorrectTouchOff: (Activity.READY, correct_touch_off),
    commands.AskTruth: (Activity.READY, ask_truth),
}
"""Activity shown and handler for each command. Hold and Acknowledge do not wait their turn."""
