"""The simulated PMAC: variables, motors, coordinate systems, program buffers and its background cycle.

It has no clock of its own: the caller advances it by servo cycles. Background tasks (limits, replies to the host)
run between two blocks of cycles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress

from drivers.pmac.axes import AxisDefinition, refuse_singular
from drivers.pmac.buffer_text import BufferKind
from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.listing import StoredLine
from drivers.pmac.language.structure import ExecutableProgram, link
from drivers.pmac.saving import SAVE_S
from drivers.pmac.settings import servo_cycle_ms
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.countdown import TimedVariables
from drivers.simulator.card.gather_buffer import GatherBuffer
from drivers.simulator.card.guard import MotorFault, action_on_fault
from drivers.simulator.card.jog_motion import HomeSensor
from drivers.simulator.card.leads import Conversion, Leads
from drivers.simulator.card.motor import Motor
from drivers.simulator.card.plc_programs import PlcPrograms
from drivers.simulator.card.saved_state import Flash
from drivers.simulator.card.stretch import Stretch
from drivers.simulator.card.table_memory import CardHost, OpenBuffer, Password, TableMemory
from drivers.simulator.plant.axis import BARE_COAST_S, BARE_ORIGIN, Axis, IdealAxis

ALL_MOTORS, MOTORS_OF_SYSTEM = 0, 1  # which motors a fault kills
INDEX_COUNTS = 2000.0  # distance between the home triggers of a motor without a machine


class SimulatedController:
    """State and behaviour of the controller; ports and plants are attached from outside.

    `servo_period_ms` is the true rate of the hardware; I10 is only the controller's setting of it. `programs` are
    the lines of the stored motion programs, by number. `stretch` runs coupled motors.
    """

    def __init__(
        self,
        i_variables: Mapping[int, float],
        axes: Mapping[int, tuple[Axis, HomeSensor]],
        definitions: tuple[AxisDefinition, ...],
        servo_period_ms: float,
        dialect: Dialect = PMAC,
        flash: Flash | None = None,
    ) -> None:
        """Restore `flash`, see `Flash.power_up`. Motors without an axis in `axes` are ideal, with no mechanics."""
        self.servo_period_ms = servo_period_ms
        self.dialect = dialect
        self.cycles, self.watchdog_tripped = 0, False
        self._saved_at_cycle = 0
        self.variables = TimedVariables(i_variables, dialect, lambda: self.cycles)
        self.host = CardHost(self.switch_plc)
        self.plcs = PlcPrograms(self.variables, self.host)
        self.programs: dict[int, list[StoredLine]] = {}
        self.open_buffer: OpenBuffer | None = None
        self.password = Password()
        self.flash = flash or Flash()
        self.motors = {}
        for number in range(1, dialect.motor_count + 1):  # also those that the machine does not use
            bare = IdealAxis(servo_period_ms / 1000.0, BARE_COAST_S, BARE_ORIGIN), HomeSensor(period=INDEX_COUNTS)
            self.motors[number] = Motor(number, self.variables, *axes.get(number, bare))
        self._busy: set[int] = set()
        self.systems = {
            number: CoordinateSystem(
                number, self.variables, self.motors, self._program_code, self.host, self._busy
            )
            for number in range(1, dialect.system_count + 1)
        }
        self.tables = TableMemory()
        self.gather = GatherBuffer(self.variables)
        self.conversion = Conversion(self.variables, self.motors)
        self._leads = Leads(self.variables, self.motors, self.systems, self.conversion, self.tables)
        self._all_systems = tuple(self.systems.values())
        self.stretch = Stretch(self._leads, self._all_systems, self.gather)
        self._with_plant = frozenset(axes)
        self._profile = dict(i_variables), definitions
        self._awake: tuple[Motor, ...] = ()
        self._revision = -1  # of the settings when a block last began
        self._cycle_revision, self._cycle_ms = -1, 0.0
        self._define_axes()
        self.flash.power_up(self)
        self._power_up()

    @property
    def cycle_ms(self) -> float:
        """Servo time as I10 states it, ms: what trajectories are calculated with."""
        if self.variables.i_revision != self._cycle_revision:
            self._cycle_revision = self.variables.i_revision
            self._cycle_ms = servo_cycle_ms(self.variables.i(10))
        return self._cycle_ms

    @property
    def now_ms(self) -> float:
        """Time since the start, as a count of servo cycles."""
        return self.cycles * self.servo_period_ms

    @property
    def saving(self) -> bool:
        """Whether it writes its flash memory: servo, programs and PLC 0 continue, the background waits."""
        return self.cycles < self._saved_at_cycle

    @property
    def any_program_running(self) -> bool:
        """Whether a coordinate system runs a program."""
        return any(system.running for system in self._all_systems)

    def run_block(self, cycles: int) -> dict[int, list[float]]:
        """Run `cycles` servo cycles; return the true machine positions (counts) of each motor that is awake."""
        if self.variables.i_revision != self._revision:
            # Motors that are not activated are off, and cost no computing time.
            self._revision = self.variables.i_revision
            self._kill(
                [motor for motor in self.motors.values() if motor.amplifier_enabled and not motor.activated]
            )
            self._awake = tuple(m for m in self.motors.values() if m.activated or m.number in self._with_plant)
        if not (self._leads.refresh() or self.gather.running or self.plcs.foreground):
            return self._run(cycles, self.cycle_ms)
        tracks: dict[int, list[float]] = {motor.number: [] for motor in self._awake}
        done = 0
        while done < cycles:
            part, interrupt = cycles - done, self.plcs.cycles_to_interrupt(self.cycles)
            if self.plcs.foreground:
                part = min(part, interrupt)
            if not (self._leads.refresh() or self.gather.running):
                run = self._run(part, self.cycle_ms)
            elif (part := self.stretch.length(self._awake, part, self.cycle_ms)) > 1:
                run = self.stretch.run(self._awake, part, self.cycle_ms, self._count)
            else:
                run = self._run(1, self.cycle_ms)
            for number, track in run.items():
                tracks[number] += track
            if part == interrupt:
                self.plcs.scan_foreground()
            done += part
        return tracks

    def background(self) -> None:
        """Check every motor and scan the PLCs, between two servo interrupts and in no fixed time."""
        for motor in self._awake:
            alarm = motor.check()
            if alarm is None:
                continue
            if alarm is MotorFault.TRAVEL:
                system = self.system_of(motor.number)
                if system is not None and (system.running or system.moving):
                    system.abort(closing=False)
                motor.stop_on_limit()
            else:
                self._trip(motor, alarm)
        self.plcs.scan_background()

    def switch_plc(self, enable: bool, numbers: tuple[int, ...], keeping: bool = False) -> None:
        """ENABLE, DISABLE, RESUME (`keeping`) and PAUSE PLC, from any source. It switches all of them or none.

        Raises PmacError: 007, one to be enabled is open; 009 or 016, it is not well formed.
        """
        opened = self.open_buffer
        if keeping:
            switches = self.plcs.switches
            self.plcs.switches = switches.resume(numbers) if enable else switches.pause(numbers)
        elif not enable:
            self.plcs.disable(numbers)
        elif opened is not None and opened.kind is BufferKind.PLC and opened.number in numbers:
            raise PmacError(ErrorCode.BUFFER_IN_USE, f"{opened} is open")
        else:
            self.plcs.enable(numbers)

    def system_of(self, motor: int) -> CoordinateSystem | None:
        """Return the coordinate system that a motor is assigned to."""
        return next((s for s in self._all_systems if motor in s.frame.definitions), None)

    def refuse_in_control(self, motor: int) -> None:
        """Check that a motor may be jogged, homed or killed. Raises PmacError: 001, a program moves it."""
        system = self.system_of(motor)
        if system is not None and system.in_control:
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"#{motor} is moved by &{system.number}")

    def define_axis(self, system: int, motor: int, definition: AxisDefinition | None) -> None:
        """Assign a motor to axes of a coordinate system.

        Raises:
            PmacError: 001 while a program moves axes; 003 when the motor belongs to another system, or the motors
                of the system would not determine its axes.
        """
        if any(other.running or other.moving for other in self._all_systems):
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, "axis definition")
        owner = self.system_of(motor)
        if owner is not None and owner.number != system:
            raise PmacError(ErrorCode.DATA_ERROR, f"motor {motor} is in &{owner.number}")
        if definition is not None and definition.inverse and self.dialect.kinematics is None:
            raise PmacError(ErrorCode.DATA_ERROR, "this family has no inverse kinematics")
        if definition is not None:
            refuse_singular({**self.systems[system].frame.definitions, motor: definition}.values())
        self.systems[system].define(motor, definition)

    def save(self) -> None:
        """Save the present state, and begin the seconds of writing. Raises ProfileError: it cannot be written."""
        self.flash.save(self)
        self._saved_at_cycle = self.cycles + round(1000.0 * SAVE_S / self.servo_period_ms)

    def read_absolute_position(self, motor: int) -> None:
        """`$*`: there is no absolute encoder; the motor is killed, not homed, and at 0, with its axes unshifted.

        Raises PmacError: 001, a program moves it, or is held on its way.
        """
        system = self.system_of(motor)
        if system is not None and (system.running or system.moving):
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"#{motor} is moved by &{system.number}")
        self.motors[motor].read_absolute_position()
        if system is not None:
            system.define(motor, system.frame.definitions[motor])

    def each_system(self, act: Callable[[CoordinateSystem], None]) -> None:
        """Apply a command to every coordinate system that does not refuse it."""
        for system in self._all_systems:
            with suppress(PmacError):
                act(system)

    def abort_all(self) -> None:
        """Control-A: abort every program; every activated motor ramps down; open loops are closed."""
        self.each_system(CoordinateSystem.kill)
        for motor in self.motors.values():
            if motor.activated:
                motor.abort()

    def kill_all(self) -> None:
        """Control-K: open every loop."""
        self.each_system(CoordinateSystem.kill)
        for motor in self.motors.values():
            motor.kill()

    def reset(self, factory: Mapping[int, float] | None = None) -> None:
        """Restart from the saved or the machine's settings, or from factory defaults, which clear everything.

        The password has to be entered again; the factory default is none.
        """
        self.kill_all()
        for motor in self.motors.values():
            motor.reset()
        self.watchdog_tripped, self._saved_at_cycle = False, 0
        self.open_buffer = None
        self.gather.clear()
        self.tables.leave()
        self.conversion.reset()
        self.host.pending_commands.clear()
        self.host.host_messages.clear()
        self.variables.replace_i(self._profile[0] if factory is None else factory)
        self.each_system(CoordinateSystem.reset)
        self.password = Password("" if factory is not None else self.password.text)
        if factory is not None:
            self.programs.clear()
            self.each_system(lambda system: system.kinematic_lines.clear())
            self.plcs.buffers.clear()
            self.variables.pointers.clear()
            self.tables.replace(())
        else:
            self._define_axes()
            self.flash.restore(self)
        self._power_up()

    def _run(self, cycles: int, cycle_ms: float) -> dict[int, list[float]]:
        """Run servo cycles without coupled motors, or a single cycle."""
        leads = self._leads
        if leads.active:
            leads.begin_cycle()
        commands: dict[int, list[float]] = {}
        for system in self._all_systems if self._busy else ():
            if system.busy:
                commands.update(system.sample(cycles, cycle_ms))
        self.cycles += cycles
        tracks = {}
        for motor in self._awake:
            if leads.active:
                leads.correct(motor)
            tracks[motor.number] = motor.run(cycles, cycle_ms, commands.get(motor.number))
        if self.gather.running:
            self.gather.sample()
        return tracks

    def _count(self, cycles: int) -> None:
        self.cycles += cycles

    def _program_code(self, number: int) -> ExecutableProgram | None:
        """Return a stored program, None if there is none. Raises PmacError: 009 or 016, it is not well formed."""
        lines = self.programs.get(number)
        return None if lines is None else link(tuple([line.statements for line in lines]))

    def _define_axes(self) -> None:
        for definition in self._profile[1]:
            self.systems[1].define(definition.motor, definition)

    def _power_up(self) -> None:
        """Start with the present settings: PLCs are enabled, and the loops that Ix80 selects are closed."""
        self.plcs.power_up()
        for motor in self.motors.values():
            if motor.activated and int(motor.variable(80)) & 1:
                motor.enable()

    def _trip(self, motor: Motor, alarm: MotorFault) -> None:
        """Kill a faulty motor and the neighbours in its flag mode; the other motors of their program ramp down."""
        system = self.system_of(motor.number)
        action = action_on_fault(self.variables, motor.number)
        others: Iterable[Motor] = (motor,)
        if action == ALL_MOTORS:
            others = self.motors.values()
        elif action == MOTORS_OF_SYSTEM and system is not None:
            others = system.frame.motors
        self._kill(others)
        motor.fatal_error = alarm is MotorFault.FOLLOWING_ERROR
        motor.amplifier_fault = alarm is MotorFault.AMPLIFIER

    def _kill(self, motors: Iterable[Motor]) -> None:
        """Kill motors, and abort the programs that move them; the other motors of those ramp down."""
        numbers = {motor.number for motor in motors}
        for system in self._all_systems:
            if not numbers.isdisjoint(system.frame.definitions):
                system.abort(closing=False)
        for number in numbers:
            self.motors[number].kill()
