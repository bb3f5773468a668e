"""Run an identification, from enabling the drives to the result: refusals first, then one sine after the other.

The paths differ in how the reference gets from the spindle to the loop, and the spindle must be at standstill.
So `pvt` is measured directly; `cam` with the carriage in place of the spindle; and `timebase` is the path of
`pvt` plus the one-cycle delay of its time base, which cannot be measured at standstill. The controller is
restored.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace

from drivers.commissioning.reading import LISTING_TIMEOUT_S, ask_or_none, read_gathering, read_settings
from drivers.errors import DriverError, RefusedError
from drivers.identification.excitation import CamPath, Excitation, PvtPath
from drivers.identification.measuring import GAINS, SERVO_TIME, SettingsComparison, measure
from drivers.identification.request import IdentificationRequest, request_problems, swung_um
from drivers.identification.result import COMPOSED, MEASURED, IdentifiedPoint, IdentifiedResponse, ResponseOrigin
from drivers.identification.rig import Rig, is_homed, put_back, refuse_unready, standing_problems
from drivers.identification.standstill import link_problems
from drivers.lathe.snapshot import AxisName
from drivers.pmac.client import PmacClient
from drivers.pmac.compensation.table import step_counts
from drivers.pmac.compensation.table_text import read_table, table_lines
from drivers.pmac.language.errors import PmacError
from drivers.pmac.settings import servo_cycle_ms
from profiles.compensations.path import delay_response
from profiles.problem import Problem, ProblemError

MOST_STEP_COUNTS = 10.0  # by switching the table: the carriage rests within counts of its zero

Tell = Callable[[IdentifiedPoint], None]  # called with each point of the result as soon as it is measured


def take_up(rig: Rig) -> None:
    """Enable the drives and home the axes that are not homed; the axes move.

    On any error the machine is brought to rest, drives disabled, before the error is raised.
    Raises RefusedError: `identify.drives_on`, nothing was sent; ProblemError: what went wrong, or who stopped it.
    """
    snapshot = rig.lathe.snapshot()
    if not snapshot.loops_open:
        raise RefusedError(Problem(code="identify.drives_on", where=rig.where))
    try:
        rig.lathe.enable()
        if not is_homed(snapshot):
            rig.lathe.home()
    except BaseException as error:
        _leave_at_rest(rig, error)
        raise


def kept_table(client: PmacClient, motor: int) -> tuple[str, ...]:
    """Return the lines that send the table of a motor again; empty where it has none.

    A cut by `cam` leaves its table in the controller, switched off; a table may be another host's, too.

    Raises RefusedError: `identify.in_use`, one that is not understood; it stays. LinkError: the link broke.
    """
    definition = ask_or_none(client, f"#{motor}LIST COMP DEF")
    if not definition:
        return ()
    listed = client.question(f"#{motor}LIST COMP", LISTING_TIMEOUT_S)
    try:
        table = read_table([f"#{motor} DEFINE COMP {definition[0].strip()}", *listed], client.dialect.motor_count)
    except PmacError as unknown:
        problem = Problem(code="identify.in_use", where=client.link.address, key=f"#{motor} COMP")
        raise RefusedError(problem) from unknown
    return tuple(table_lines(table))


def identify(
    rig: Rig, request: IdentificationRequest, origin: ResponseOrigin, date: str, tell: Tell = lambda _: None
) -> IdentifiedResponse:
    """Measure the response of one path, with the drives enabled, homed, and everything at rest.

    On any error or stop the machine is brought to rest, drives disabled, and the controller restored before the
    error is raised. A machine of which another console has taken control is left as it is.
    Raises RefusedError: nothing has moved; ProblemError: what went wrong, or who stopped it.
    """
    settings = SettingsComparison(rig, origin)
    refuse_unready(rig, request_problems(request, rig.machine))
    if problems := (*standing_problems(rig), *link_problems(rig, swung_um(request, rig.machine))):
        raise RefusedError(*problems)
    excitation: Excitation = PvtPath(rig.machine, request.amplitude_um)
    if request.path.traits.by_table:
        excitation = CamPath(rig.machine, request.amplitude_um, max(request.frequencies_hz))
    # By how many servo cycles the path's reference is later than the one measured here.
    cycles = request.path.traits.late_cycles(rig.machine) - excitation.late_cycles
    gathering = read_gathering(rig.client, rig.dialect)
    table = excitation.table is not None
    before = kept_table(rig.client, rig.machine.tool.motor) if table else ()
    points = []
    try:
        _place(rig, excitation, occupied=bool(before))
        for frequency_hz in request.frequencies_hz:
            if table:
                rig.lathe.jog_to(AxisName.CARRIAGE, 0.0, settle=False)
            point = measure(rig, excitation, frequency_hz, request)
            points.append(_delay_point(point, cycles * origin.servo_period_ms / 1000.0))
            tell(points[-1])
        if table:  # at the zero of the table switching it off causes next to no step
            rig.lathe.jog_to(AxisName.CARRIAGE, 0.0)
            _refuse_step(rig, excitation)
        put_back(rig, gathering, table=table, table_before=before)
        settings.refuse_changed()
    except BaseException as error:
        restore_after(rig, gathering, error, table=table, table_before=before)
        raise
    return IdentifiedResponse(
        origin=origin,
        path=request.path,
        how=COMPOSED if cycles else MEASURED,
        delay_cycles=cycles,
        date=date,
        points=tuple(points),
    )


def origin_of(rig: Rig, *, version: str, kind: str, simulated: bool) -> ResponseOrigin:
    """Read what the response will be valid for. Raises DriverError: the link broke."""
    motor = rig.machine.tool.motor
    indices = {f"I{motor}{number}": rig.dialect.motor_index(motor, number) for number in GAINS}
    found = read_settings(rig.client, (SERVO_TIME, *indices.values()))
    return ResponseOrigin(
        machine=rig.machine.name,
        simulated=simulated,
        version=version,
        kind=kind,
        gains={name: found[index] for name, index in indices.items()},
        servo_period_ms=servo_cycle_ms(found[SERVO_TIME]),
    )


def _place(rig: Rig, excitation: Excitation, *, occupied: bool) -> None:
    """Bring the tool to its zero, clear of everything; with a table the carriage too, and switch it on there.

    `occupied`: the tool has a table, which is kept.
    """
    rig.lathe.jog_to(AxisName.TOOL, 0.0, settle=False)
    if excitation.table is None:
        return
    rig.lathe.jog_to(AxisName.CARRIAGE, 0.0, settle=False)
    deletion = (f"#{rig.machine.tool.motor}DELETE COMP",) if occupied else ()
    for line in (*deletion, *table_lines(excitation.table)):
        rig.lathe.stop.check()
        rig.client.request(line, lines=0)
    _refuse_step(rig, excitation)
    rig.client.request("I51=1", lines=0)


def _refuse_step(rig: Rig, excitation: Excitation) -> None:
    assert excitation.table is not None  # ensured by the callers
    step = step_counts(excitation.table, [rig.lathe.snapshot().carriage.position])
    if step > MOST_STEP_COUNTS:
        value, limit = f"{step:.1f} counts", f"<= {MOST_STEP_COUNTS:g} counts"
        raise DriverError(Problem(code="identify.table_steps", key="carriage", value=value, limit=limit))


def restore_after(
    rig: Rig,
    gathering: Mapping[int, float],
    error: BaseException,
    *,
    table: bool,
    table_before: tuple[str, ...] = (),
) -> None:
    """Leave the machine at rest, and restore the settings used, if they are ours and cause no step."""
    off = False
    try:
        _leave_at_rest(rig, error)
        off = True
    finally:
        if not rig.lathe.anothers:
            with suppress(DriverError):  # the first error matters more
                put_back(rig, gathering, table=table and off, table_before=table_before)


def _leave_at_rest(rig: Rig, error: BaseException) -> None:
    """Stop, wait for rest and disable the drives; another console's machine is left once nothing of ours moves."""
    lathe = rig.lathe
    code = error.problems[0].code if isinstance(error, ProblemError) and error.problems else type(error).__name__
    if lathe.anothers:
        return
    try:
        if lathe.stop.reason is None:
            lathe.stop.stop(code)
        lathe.wait_for_rest()
        if not lathe.anothers:
            lathe.switch_off()
    except ProblemError as unproven:
        problems = error.problems if isinstance(error, ProblemError) else (Problem(code=code),)
        raise DriverError(*problems, *unproven.problems, Problem(code="machine.state_unknown")) from error


def _delay_point(point: IdentifiedPoint, delay_s: float) -> IdentifiedPoint:
    if not delay_s:
        return point
    measured = cmath.rect(1.0, math.radians(point.phase_deg))
    return replace(
        point, phase_deg=math.degrees(cmath.phase(delay_response(measured, point.frequency_hz, delay_s)))
    )
