"""The simulated lathe: controller, machine and the part in its chuck, on one clock advanced by the caller."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from drivers.errors import LinkError
from drivers.lathe_placement import LathePlacement
from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import DIALECTS, Dialect
from drivers.pmac.language.errors import PmacError
from drivers.pmac.requests import DefaultAddress
from drivers.pmac.settings import settings_with
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.card.motor import Motor
from drivers.simulator.card.registers import CardMemory
from drivers.simulator.card.saved_state import Flash
from drivers.simulator.card.stretch import LoadedAxis
from drivers.simulator.card.watchdog import Background
from drivers.simulator.commands.line import commands
from drivers.simulator.commands.status import ACTIONS
from drivers.simulator.context import ALL_CARDS, Context
from drivers.simulator.faults.board import FaultBoard, inject_words, words_of
from drivers.simulator.faults.catalogue import AXES, refusal
from drivers.simulator.faults.effects import FaultTarget
from drivers.simulator.faults.lines import Lines
from drivers.simulator.hosts import replies
from drivers.simulator.hosts.port import WORK_PER_TURN, Port
from drivers.simulator.plant.collision import Collision
from drivers.simulator.plant.dials import ShopDials
from drivers.simulator.plant.drives import build_drives
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from drivers.simulator.plant.workshop import SimulatedWorkshop
from drivers.simulator.plant.workshop_view import Truth, WorkshopView
from profiles.compensations.trial_band import BandReadings
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.metrology.cylindricity import PartSection
from profiles.problem import Problem
from profiles.traces import Trace

COMMANDS_PER_CYCLE = 16  # maximum program commands per background cycle, fewer when they are costly


def speak(controller: SimulatedController, ports: Sequence[Port]) -> None:
    """Execute the programs' requests since the last cycle: CMD, and messages to all hosts, SEND."""
    pending, messages = controller.host.pending_commands, controller.host.host_messages
    if not pending and not messages:
        return
    done = work = 0
    while pending and done < COMMANDS_PER_CYCLE and work < WORK_PER_TURN:
        said, cost = _command(controller, *pending.popleft())
        done, work = done + 1, work + cost
        if said:
            _announce(said, ports)
    while messages:
        text, _ = messages.popleft()
        _announce(replies.message(text, replies.wording(controller.variables)), ports)


def _command(
    controller: SimulatedController, text: str, port: str, addressed: DefaultAddress
) -> tuple[bytes, int]:
    """Execute a command as from a host; return the cost, and the output, data only for a named port."""
    motor, system = addressed.motor, addressed.system
    context = Context(controller, motor_number=motor, system_number=system, card_number=ALL_CARDS)
    try:
        if len(text) == 1 and ord(text) < ord(" "):
            action = ACTIONS.get(ord(text))
            report = action(context) if action is not None else None
            context.lines += [report] if report is not None else []
        else:
            for _ in commands(text, context):
                pass
    except PmacError as refusal:
        how = replies.wording(controller.variables)
        # With I6 = 2 only hosts get error messages.
        return b"" if how.errors == 2 else replies.error_reply(refusal.code, how), context.work
    how = replies.wording(controller.variables)
    return b"".join(replies.message(line, how) for line in context.lines if port), context.work


def _announce(said: bytes, ports: Sequence[Port]) -> None:
    for port in ports:
        port.announce(said)


class SimulatedLathe:
    """A machine profile brought to life. Time is whole servo cycles; nothing here sleeps."""

    def __init__(
        self,
        machine: MachineProfile,
        true: TrueParameters | None = None,
        dialect: Dialect | None = None,
        saved: Path | None = None,
        *,
        blind: bool = False,
    ) -> None:
        """Set the controller up as the profile says; the machine is as `true` says, by default the same.

        `dialect` is the family of the controller, by default that of the profile. `saved` is the file that SAVE
        writes; an earlier saved state in it is restored. A `blind` lathe shows what can be read at it, not the
        truth.

        Raises ProfileError: `file.unreadable`, there is something else in that file.
        """
        self._machine = machine
        true = true or ideal(machine)
        self.which, self.parts_differ = true.lathe, true.parts_differ
        dialect = dialect or DIALECTS[machine.controller.family]
        # As on any machine in the field the checksums of the line, on in one family's factory settings, are off.
        variables = settings_with({"I4": 0, **machine.controller.variables}, dialect)
        self._drives = build_drives(machine, true, variables)
        self.tool, self.spindle, self.carriage = self._drives.tool, self._drives.spindle, self._drives.carriage
        self.controller = SimulatedController(
            variables,
            self._drives.axes(),
            read_definitions(machine.controller.axis_definitions),
            machine.controller.servo_period_ms,
            dialect,
            Flash(saved),
        )
        self._block = max(1, round(machine.controller.background_ms / machine.controller.servo_period_ms))
        tool, spindle, carriage = self._motors()
        tool.scale = self.tool.scale
        if self._drives.load is not None:
            self._drives.load.watch(tool, spindle, carriage)
            self.controller.stretch.loaded = LoadedAxis(self._drives.load, tool, (spindle, carriage))
        self._gains_revision = -1  # the saved gains may differ from the profile's
        self.controller.variables.memory = CardMemory(self.controller)
        self._ports: list[Port] = []
        self.lines = Lines(now_s=self.now_s)
        self._background = Background(self.controller, self.lines)
        self.faults = FaultBoard(self._fault_target())
        self._floor = SimulatedWorkshop(machine, true, self._drives)
        self._dials = ShopDials(true) if blind else None
        self._debt_cycles = 0.0

    @property
    def parts(self) -> int:
        """How many blanks were clamped on it so far."""
        return self._floor.parts

    def connect(self) -> Port:
        """Connect a host. Raises LinkError: `link.refused`, the cable is cut."""
        if self.lines.cut:
            raise LinkError(Problem(code="link.refused", where="memory", value="the cable is cut"))
        port = Port(self.controller, self.lines)
        self._ports.append(port)
        return port

    def disconnect(self, port: Port) -> None:
        """Disconnect it, if it is not cut off already."""
        if port in self._ports:
            port.disconnect()
            self._ports.remove(port)

    def disconnect_all(self) -> None:
        """Disconnect every host that is not cut off already."""
        for port in tuple(self._ports):
            self.disconnect(port)

    def forget(self, port: Port) -> None:
        """Disconnect a host without notification: a buffer that it has opened stays open."""
        if port in self._ports:
            self._ports.remove(port)

    def attend(self, port: Port) -> None:
        """Let the controller serve one host now, between two background cycles; no time passes."""
        if not (self.lines.slow or self.controller.saving):
            port.obey()
            port.service()

    def power_cycle(self) -> None:
        """Power-cycle the controller: a reset, and pending host input is lost. Network boards are disconnected."""
        self._background.power_cycle()
        for port in tuple(self._ports):
            port.power_up()
            if port.on_board:
                self._cut_off(port)
        self.faults.power_up()
        self.faults.follow()

    def now_s(self) -> float:
        """Return the simulated time."""
        controller = self.controller
        return controller.cycles * controller.servo_period_ms / 1000.0  # `now_ms`, without its call

    def wait(self, seconds: float) -> None:
        """Advance by `seconds`; a remainder below a background cycle is kept for the next call."""
        self._debt_cycles += seconds * 1000.0 / self.controller.servo_period_ms
        while self._debt_cycles >= self._block:
            self._debt_cycles -= self._block
            self._run_block()

    def mount(self, job: Job) -> None:
        """Clamp a new blank for `job`."""
        self._floor.mount(job)

    def take_over(self, placed: LathePlacement) -> None:
        """Be as somebody left it: homed where the axes stand, with the blank of a job clamped.

        The lathe was made by the true parameters of `begun_at`.
        """
        if placed.axes is not None:
            for motor in self._motors():
                motor.know_home()
        if placed.job is not None:
            self.mount(placed.job)

    def measure(self, past_middle_mm: float = 0.0, *, turned_deg: float = 0.0) -> Trace:
        """Release the part and measure its trace, see `SimulatedWorkshop.measure`."""
        return self._floor.measure(past_middle_mm, turned_deg)

    def sections(self) -> tuple[PartSection, ...]:
        """Return sections of the part that was measured, see `SimulatedWorkshop.sections`."""
        return self._floor.sections()

    def measure_clamped(self) -> Trace:
        """Measure the part in the chuck, see `SimulatedWorkshop.measure_clamped`."""
        return self._floor.measure_clamped()

    def indicate(self, places: int | None = None) -> ClampReadings:
        """Return what an indicator shows of the clamping, see `SimulatedWorkshop.indicate`."""
        return self._floor.indicate(places)

    def indicate_band(self, behind_face_mm: float) -> BandReadings:
        """Return what an indicator shows of the clamped part, see `SimulatedWorkshop.indicate_band`."""
        return self._floor.indicate_band(behind_face_mm)

    def look(self) -> WorkshopView:
        """Return what an operator sees at the chuck, without counts and zeros."""
        places = [motor.true_position for motor in self._motors()]
        if self._dials is None:
            return self._floor.look(*places)
        return self._dials.blind(self._floor.at_the_chuck(*places))

    def truth(self) -> Truth:
        """Return what is so at the lathe, see `SimulatedWorkshop.truth`."""
        return self._floor.truth()

    def fault(self, line: str) -> str:
        """Inject the fault of a line `inject NAME [KEY=VALUE ...]`, or end all by `clear`; return its name.

        Raises RefusedError: `simulator.fault`.
        """
        word, *words = words_of(line)
        if word == "clear":
            self.faults.clear()
            return word
        if word != "inject" or not words:
            raise refusal("", "command", word, "inject NAME [KEY=VALUE ...] | clear")
        return inject_words(self.faults, words[0], words[1:]).fault.name

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """The collisions since the last blank was clamped, each kind once."""
        return self._floor.watch.found

    def set_spindle(self, rpm: float | None) -> None:
        """Set a spindle on an inverter at the lathe: it ramps to `rpm`, positive in the direction of the cut.

        None disables it: it coasts.

        Raises RuntimeError: the controller drives this spindle, or it is not made for that speed.
        """
        most_rpm = self._machine.spindle.max_speed_rpm
        if rpm is not None and not abs(rpm) <= most_rpm:
            raise RuntimeError(f"the spindle turns at most {most_rpm:g} rpm, not {rpm:g}")
        inverter = self._drives.inverter
        if inverter is None:
            raise RuntimeError("the controller drives this spindle: there is no inverter")
        if rpm is None:
            inverter.switch_off()
        else:
            inverter.set_rpm(rpm)

    def _motors(self) -> tuple[Motor, Motor, Motor]:
        """Return the motors of tool, spindle and carriage."""
        machine, motors = self._machine, self.controller.motors
        return motors[machine.tool.motor], motors[machine.spindle.motor], motors[machine.carriage.motor]

    def _fault_target(self) -> FaultTarget:
        return FaultTarget(
            controller=self.controller,
            motors=dict(zip(AXES, self._motors(), strict=True)),
            lines=self.lines,
            background=self._background,
            cut=self._cut_off_all,
            card=self,
        )

    def _cut_off(self, port: Port) -> None:
        """Disconnect a host that notices it only at its next access."""
        port.lost = True
        self.disconnect(port)

    def _cut_off_all(self) -> None:
        for port in tuple(self._ports):
            self._cut_off(port)

    def _run_block(self) -> None:
        controller = self.controller
        if controller.variables.i_revision != self._gains_revision:
            self._gains_revision = controller.variables.i_revision
            self._drives.take_gains(controller.variables)
        tracks = controller.run_block(self._block)
        self._floor.pass_along(tracks, controller.now_ms)
        self.faults.follow()
        if not self._background.comes():
            return
        controller.background()
        # Program and PLC commands first: a host's stop in the same cycle takes precedence.
        speak(controller, self._ports)
        # Every host's stops before any host's lines.
        for port in self._ports:
            port.obey()
        for port in self._ports:
            port.service()
