"""The drives of a simulated lathe, built from its profile and its true parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.pmac.variables import VariableStore
from drivers.simulator.card.jog_motion import HomeSensor
from drivers.simulator.card.servo import ServoAxis
from drivers.simulator.plant.axis import Axis, EncoderAxis, IdealAxis, NoisyScale, Scale, ends_at, read_encoder
from drivers.simulator.plant.driven_mass import DrivenMass, Presliding, SimulatedMode, linear_motor
from drivers.simulator.plant.servo_gains import ServoGains
from drivers.simulator.plant.spindle import RadialError, SimulatedSpindle
from drivers.simulator.plant.tip_load import TipGeometry, TipLoad
from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.axis.notch import Notch, SignConvention
from profiles.axis.servo_gains import NOTCH_NUMBERS
from profiles.machine import DAC_BITS, MachineProfile


class InverterSpindle(EncoderAxis):
    """A spindle that turns as its inverter commands, whatever the controller commands.

    `load_n_m` is the torque of the cut. Enabled while it coasts, the inverter catches it at its speed. The slip is
    `slip_rpm` of its true parameters at the peak torque, or less below.
    """

    def __init__(self, true: TrueParameters, counts_per_turn: float, cycle_s: float, origin: float) -> None:
        super().__init__(origin)
        self.load_n_m = 0.0
        self._true = true
        self._counts_per_rad = counts_per_turn / (2.0 * math.pi)
        self._cycle_s = cycle_s
        self._speed = 0.0  # rad/s
        self._field = 0.0  # inverter output, rad/s
        self._target: float | None = None  # rad/s; None is disabled

    @property
    def speed_rpm(self) -> float:
        """Its true speed."""
        return self._speed * 30.0 / math.pi

    def set_rpm(self, rpm: float) -> None:
        """Enable and ramp to a speed; positive is the direction of the cut."""
        if self._target is None:
            self._field = self._speed
        self._target = rpm * math.pi / 30.0

    def switch_off(self) -> None:
        """Let it coast."""
        self._target = None

    def close_loop(self) -> float:
        """Return the present reading, the last one of an encoder that does not count; there is no loop."""
        return self._reading if self.encoder_lost else read_encoder(self._x)

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Turn; the commands have no effect."""
        return self.coast(len(commands))

    def push(self, output: float, cycles: int) -> list[float]:
        """Turn; the output has no effect."""
        return self.coast(cycles)

    def coast(self, cycles: int) -> list[float]:
        """Turn as the inverter commands, or coast."""
        track, steady = [], False
        x, speed, cycle_s, counts_per_rad = self._x, self._speed, self._cycle_s, self._counts_per_rad
        for _ in range(cycles):
            before = speed
            if not steady:
                # The field that has come to its target stays, and so does all that follows from it.
                steady = not self.jammed and self._field == self._target
                speed = self._speed = self._next_speed()
            x += 0.5 * (before + speed) * cycle_s * counts_per_rad
            track.append(x)
        self._x = x
        self._blind = self.encoder_lost
        if not self._blind:
            self._reading = float(read_encoder(self._x))
        return track

    def _next_speed(self) -> float:
        """Return the speed a cycle later: the field less the slip, or decelerated by drag and load."""
        true = self._true
        inertia_kg_m2, drag_n_m_s_per_rad = true.spindle_inertia_kg_m2, true.spindle_drag_n_m_s_per_rad
        against_n_m = true.spindle_friction_n_m + self.load_n_m
        if self._target is None:
            slower = self._speed * math.exp(-drag_n_m_s_per_rad / inertia_kg_m2 * self._cycle_s)
            slower -= math.copysign(against_n_m / inertia_kg_m2 * self._cycle_s, self._speed)
            stopped = self.jammed or slower * self._speed <= 0.0
            return 0.0 if stopped else slower
        if self.jammed:
            self._field = 0.0  # freed, it accelerates again by the ramp
            return 0.0
        most = true.ramp_rpm_per_s * math.pi / 30.0 * self._cycle_s
        self._field += max(-most, min(self._target - self._field, most))
        per_n_m = true.slip_rpm * math.pi / 30.0 / true.spindle_peak_torque_n_m
        loaded = abs(self._field) - per_n_m * against_n_m
        # The drag is part of the load, and depends on the resulting speed.
        return math.copysign(max(loaded, 0.0) / (1.0 + per_n_m * drag_n_m_s_per_rad), self._field)


GAINS = (8, 9, 30, 31, 32, 33, 34, 35, *NOTCH_NUMBERS, 63, 69)
"""The numbers of the variables that are `ServoGains`."""

NOTCH = tuple(f"ix{number}" for number in NOTCH_NUMBERS)
MotorVariable = Callable[[int, int], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Drives:
    """The axes of one lathe. `inverter` drives the spindle where the controller does not.

    `load` is the effect of the cut on the tool, `wander` the radial error of the spindle; None is no effect.
    `reading` is how this controller reads the coefficients of a notch filter.
    """

    tool: ServoAxis
    spindle: SimulatedSpindle
    carriage: IdealAxis
    inverter: InverterSpindle | None
    load: TipLoad | None
    wander: RadialError | None
    machine: MachineProfile
    reading: SignConvention = SignConvention.STATED

    def axes(self) -> dict[int, tuple[Axis, HomeSensor]]:
        """Return the axis and the home trigger of each motor."""
        turn = float(self.machine.spindle.counts_per_rev)
        return {
            self.machine.tool.motor: (self.tool, HomeSensor()),
            self.machine.spindle.motor: (self.spindle, HomeSensor(period=turn)),
            self.machine.carriage.motor: (self.carriage, HomeSensor()),
        }

    def take_gains(self, variables: VariableStore) -> None:
        """Use the present gains of the controller."""
        self.tool.set_gains(_gains(self.machine.tool.motor, variables.motor, self.reading))
        if isinstance(self.spindle.drive, ServoAxis):
            spindle = _gains(self.machine.spindle.motor, variables.motor, self.reading)
            self.spindle.drive.set_gains(spindle)


def build_drives(machine: MachineProfile, true: TrueParameters, settings: dict[int, float]) -> Drives:
    """Return the drives; `settings` are the I-variables of the controller."""

    def setting(motor: int, suffix: int) -> float:
        return settings.get(100 * motor + suffix, 0.0)

    spindle = _spindle_drive(machine, true, setting)
    cycle_s = _cycle_s(machine)
    per_mm = machine.carriage.counts_per_mm
    start_counts = true.carriage_start_mm * per_mm
    pp_um = true.radial_error_um_pp
    wander = RadialError(pp_um, true.chance("radial error")) if pp_um else None
    load = _load(machine, true, wander) if true.passive_fraction else None
    return Drives(
        tool=_tool(machine, true, setting, load),
        spindle=_spindle(machine, true, spindle),
        carriage=IdealAxis(cycle_s, true.coast_s, start_counts, ends_at(true.carriage_ends_mm, per_mm)),
        inverter=spindle if isinstance(spindle, InverterSpindle) else None,
        load=load,
        wander=wander,
        machine=machine,
        reading=true.notch_reading,
    )


def _tool(
    machine: MachineProfile, true: TrueParameters, setting: MotorVariable, load: TipLoad | None
) -> ServoAxis:
    tool = machine.tool
    slide = linear_motor(
        mass_kg=true.moving_mass_kg,
        damping_n_s_per_m=true.viscous_n_s_per_m,
        force_n_per_bit=true.thrust_n_per_v * tool.v_per_bit,
        peak_output_bits=math.floor(true.peak_command_v / tool.v_per_bit),
        counts_per_m=tool.counts_per_mm * 1000.0,
        friction_n=0.0 if true.presliding_um else true.coulomb_friction_n,
    )
    start_counts = true.tool_start_mm * tool.counts_per_mm
    ends = ends_at(true.tool_ends_mm, tool.counts_per_mm)
    noise_counts = true.encoder_noise_um / 1000.0 * tool.counts_per_mm
    scale = NoisyScale(noise_counts, true.chance_of_part("encoder").randrange(2**32)) if noise_counts else Scale()
    gains, lag_s = _gains(tool.motor, setting, true.notch_reading), true.current_lag_s
    loads = _presliding(machine, true, load) if true.presliding_um and true.coulomb_friction_n else load
    mode = None
    if true.flexible_fraction:
        mode = SimulatedMode(
            true.flexible_hz, true.flexible_damping, true.flexible_fraction, _cycle_s(machine), lag_s
        )
    return ServoAxis(slide, gains, _cycle_s(machine), start_counts, ends, scale, lag_s, loads, mode)


def _presliding(machine: MachineProfile, true: TrueParameters, cut: TipLoad | None) -> Presliding:
    per_mm = machine.tool.counts_per_mm
    limit = 1000.0 * per_mm * true.coulomb_friction_n / true.moving_mass_kg
    return Presliding(limit, true.presliding_um / 1000.0 * per_mm, cut)


def _load(machine: MachineProfile, true: TrueParameters, wander: RadialError | None) -> TipLoad:
    tool, spindle = machine.tool, machine.spindle
    geometry = TipGeometry(
        home_radius_mm=true.home_radius_mm,
        land_mm=true.wiper_land_mm,
        tool_counts_per_mm=tool.counts_per_mm,
        carriage_counts_per_mm=machine.carriage.counts_per_mm,
        spindle_counts_per_turn=spindle.counts_per_rev * true.belt_ratio,
    )
    return TipLoad(geometry, wander, 1000.0 * tool.counts_per_mm / true.moving_mass_kg)


def _spindle(machine: MachineProfile, true: TrueParameters, drive: Axis) -> SimulatedSpindle:
    phase_rad = true.chance("ripple").uniform(0.0, 2.0 * math.pi) if true.speed_ripple else 0.0
    counts_per_turn = machine.spindle.counts_per_rev * true.belt_ratio
    built = true.speed_ripple, true.ripple_per_turn
    return SimulatedSpindle(drive, counts_per_turn, _cycle_s(machine), built, phase_rad)


def _spindle_drive(
    machine: MachineProfile, true: TrueParameters, setting: MotorVariable
) -> ServoAxis | IdealAxis | InverterSpindle:
    """Return the spindle drive. The controller counts the encoder, which a belt may drive."""
    spindle, cycle_s = machine.spindle, _cycle_s(machine)
    counts_per_turn = spindle.counts_per_rev * true.belt_ratio
    start_counts = float(round(true.spindle_start_turns * counts_per_turn))
    if spindle.drive == "inverter":
        return InverterSpindle(true, counts_per_turn, cycle_s, start_counts)
    if true.ideal_spindle:
        return IdealAxis(cycle_s, true.coast_s, origin=start_counts)
    inertia_kg_m2, counts_per_rad = true.spindle_inertia_kg_m2, counts_per_turn / (2.0 * math.pi)
    rotor = DrivenMass(
        damping_per_s=true.spindle_drag_n_m_s_per_rad / inertia_kg_m2,
        # The amplifier gives the peak torque at the full scale of the output.
        acceleration_per_bit=true.spindle_peak_torque_n_m / DAC_BITS / inertia_kg_m2 * counts_per_rad,
        peak_output_bits=DAC_BITS,
        friction=true.spindle_friction_n_m / inertia_kg_m2 * counts_per_rad,
    )
    gains = _gains(spindle.motor, setting, true.notch_reading)
    return ServoAxis(rotor, gains, cycle_s, origin=start_counts)


def _cycle_s(machine: MachineProfile) -> float:
    return machine.controller.servo_period_ms / 1000.0


def _gains(motor: int, variable: MotorVariable, reading: SignConvention) -> ServoGains:
    values = {f"ix{number:02}": variable(motor, number) for number in GAINS}
    if reading is not SignConvention.STATED:
        n1, n2, d1, d2 = (values[name] for name in NOTCH)
        read = Notch(n1=n1, n2=n2, d1=d1, d2=d2).read_as(reading)
        values |= zip(NOTCH, read.coefficients, strict=True)
    return ServoGains(**values)
