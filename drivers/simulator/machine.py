"""The simulated lathe: the card, the iron behind it and the part in its chuck, on one clock that is advanced."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import DIALECTS, Dialect
from drivers.pmac.settings import settings_with
from drivers.simulator.controller import Controller
from drivers.simulator.home_sensor import HomeSensor
from drivers.simulator.plant.axis import IdealAxis, LinearMotor
from drivers.simulator.plant.gauge import look_at, measure_released
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from drivers.simulator.plant.workpiece import Workpiece
from drivers.simulator.port import Port
from drivers.simulator.program_voice import speak
from drivers.simulator.registers import CardMemory
from drivers.simulator.saved_state import Flash
from drivers.simulator.servo import Axis, ServoAxis, ServoGains
from drivers.simulator.shop_view import ShopView
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.traces import Trace

DAC_BITS = 32_768
"""Full scale of the 16-bit output."""

MotorVariable = Callable[[int, int], float]

MID_LENGTH = 0
"""The section in the middle of the cut, the one that is measured."""


class SimulatedLathe:
    """A machine profile made to move. Time is whole servo cycles; nothing here sleeps."""

    def __init__(
        self,
        machine: MachineProfile,
        true: TrueParameters | None = None,
        dialect: Dialect | None = None,
        saved: Path | None = None,
    ) -> None:
        """The card is set up as the profile says; the iron is what `true` says, by default the same.

        `dialect` is the family of the card, by default that of the profile. `saved` is the file that SAVE writes;
        what an earlier card has left there comes back.

        Raises:
            ProfileError: `file.unreadable`, there is something else in that file.
        """
        self._machine = machine
        self._true = true = true or ideal(machine)
        dialect = dialect or DIALECTS[machine.controller.family]
        variables = settings_with(machine.controller.variables, dialect)
        self.tool = _tool_axis(machine, true, variables)
        cycle_s = machine.controller.servo_period_ms / 1000.0
        spindle_turn = float(machine.spindle.counts_per_rev)
        spindle = IdealAxis(cycle_s, true.coast_s, origin=round(true.spindle_start_turns * spindle_turn))
        carriage_origin = true.carriage_start_mm * machine.carriage.counts_per_mm
        carriage = IdealAxis(cycle_s, true.coast_s, origin=carriage_origin)
        axes: dict[int, tuple[Axis, HomeSensor]] = {
            machine.tool.motor: (self.tool, HomeSensor()),
            machine.spindle.motor: (spindle, HomeSensor(period=spindle_turn)),
            machine.carriage.motor: (carriage, HomeSensor()),
        }
        self.controller = Controller(
            variables,
            axes,
            read_definitions(machine.controller.axis_definitions),
            machine.controller.servo_period_ms,
            dialect,
            Flash(saved),
        )
        self._block = max(1, round(machine.controller.background_ms / machine.controller.servo_period_ms))
        self._gains_revision = -1  # what was saved may be other gains than the profile's
        self.controller.variables.memory = CardMemory(self.controller)
        self._ports: list[Port] = []
        self._part: Workpiece | None = None
        self._released: Workpiece | None = None
        self._nominal_radius_mm = 0.0
        self._free_end_mm = true.jaw_face_mm
        self._debt_cycles = 0.0

    def connect(self) -> Port:
        """Plug a host in."""
        port = Port(self.controller)
        self._ports.append(port)
        return port

    def disconnect(self, port: Port) -> None:
        """Unplug it."""
        port.disconnect()
        self._ports.remove(port)

    def attend(self, port: Port) -> None:
        """Let the card look at one host now, between two background cycles; no time passes."""
        port.obey()
        port.service()

    def now_s(self) -> float:
        """Return the simulated time."""
        return self.controller.now_ms / 1000.0

    def wait(self, seconds: float) -> None:
        """Advance by `seconds`; what is less than a background cycle is kept for the next call."""
        self._debt_cycles += seconds * 1000.0 / self.controller.servo_period_ms
        while self._debt_cycles >= self._block:
            self._debt_cycles -= self._block
            self._run_block()

    def mount(self, job: Job) -> None:
        """Clamp a new blank for `job`."""
        true, self._released = self._true, None
        self._free_end_mm = true.jaw_face_mm - job.overhang_mm
        middle_mm = self._free_end_mm + 0.5 * job.cut_length_mm
        self._part = Workpiece(true.blank(job), (middle_mm,), true.wiper_land_mm)
        self._nominal_radius_mm = job.radius_mm - job.depth_of_cut_mm

    def measure(self) -> Trace:
        """Release the part and take its trace in the middle of the cut; until another is clamped, once more."""
        if self._part is not None:
            self._part, self._released = None, self._part
        if self._released is None:
            raise RuntimeError("no part is mounted")
        return measure_released(self._released, MID_LENGTH, self._nominal_radius_mm)

    def look(self) -> ShopView:
        """Look at the chuck, as an operator does who knows nothing of counts and zeros.

        A chuck that was mounted as each job says has its jaw 1 at the index until a part was clamped.
        """
        machine, true, part = self._machine, self._true, self._part
        last = part or self._released
        jaw_1_deg = last.blank.jaw_1_deg if last else true.jaw_1_deg or 0.0
        return look_at(
            part,
            (self._free_end_mm, true.jaw_face_mm),
            true.home_radius_mm - self._place(machine.tool.motor) / machine.tool.counts_per_mm,
            self._place(machine.spindle.motor) / machine.spindle.counts_per_rev,
            self._place(machine.carriage.motor) / machine.carriage.counts_per_mm,
            jaw_1_deg,
        )

    def _place(self, motor: int) -> float:
        """Return where the iron of a motor is, in counts from its flag or index, wherever its zero is."""
        moved = self.controller.motors[motor]
        return moved.actual + moved.axis.origin

    def _run_block(self) -> None:
        controller, machine = self.controller, self._machine
        if controller.variables.i_revision != self._gains_revision:
            self._gains_revision = controller.variables.i_revision
            self.tool.set_gains(_gains(machine.tool.motor, controller.variables.motor))
        tracks = controller.run_block(self._block)
        if self._part is not None:
            self._cut(self._part, tracks)
        controller.background()
        # What programs and PLCs command comes first: a stop of a host in the same cycle has the last word.
        speak(controller, self._ports)
        # Every host's stops before any host's lines.
        for port in self._ports:
            port.obey()
        for port in self._ports:
            port.service()

    def _cut(self, part: Workpiece, tracks: dict[int, list[float]]) -> None:
        machine = self._machine
        tool, spindle, carriage = machine.tool, machine.spindle, machine.carriage
        per_mm, home_mm = 1.0 / tool.counts_per_mm, self._true.home_radius_mm
        per_turn, per_z = 1.0 / spindle.counts_per_rev, 1.0 / carriage.counts_per_mm
        part.cut(
            [home_mm - x * per_mm for x in tracks[tool.motor]],
            [y * per_turn for y in tracks[spindle.motor]],
            [z * per_z for z in tracks[carriage.motor]],
        )


def _tool_axis(machine: MachineProfile, true: TrueParameters, variables: dict[int, float]) -> ServoAxis:
    tool = machine.tool
    volt_per_bit = tool.dac_full_scale_v / DAC_BITS
    motor = LinearMotor(
        mass_kg=true.moving_mass_kg,
        damping_n_s_per_m=true.damping_n_s_per_m,
        force_n_per_bit=true.force_n_per_v * volt_per_bit,
        peak_output_bits=math.floor(true.peak_command_v / volt_per_bit),
        counts_per_m=tool.counts_per_mm * 1000.0,
    )
    gains = _gains(tool.motor, lambda number, suffix: variables.get(100 * number + suffix, 0.0))
    cycle_s = machine.controller.servo_period_ms / 1000.0
    return ServoAxis(motor, gains, cycle_s, origin=true.tool_start_mm * tool.counts_per_mm)


def _gains(motor: int, variable: MotorVariable) -> ServoGains:
    return ServoGains(
        ix08=variable(motor, 8),
        ix09=variable(motor, 9),
        ix30=variable(motor, 30),
        ix31=variable(motor, 31),
        ix32=variable(motor, 32),
        ix33=variable(motor, 33),
        ix34=variable(motor, 34),
        ix35=variable(motor, 35),
        ix63=variable(motor, 63),
        ix69=variable(motor, 69),
    )
