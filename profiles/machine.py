"""The machine profile: the lathe, its drives and its chuck, in mechanical and electrical units.

Data alone. The settings of the controller are carried as a mapping from variable name to value and are not
interpreted here, except that a safety limit of 0 is refused because 0 disables that limit. A signature for the
safety devices states the machine that it is for: a signature for the simulator does not permit a real machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from profiles.fields import is_blank, read_fields, schema_problem, spell_toml, unknown_keys
from profiles.machine_fields import (
    OPTIONAL_SECTIONS,
    SECTIONS,
    SIGNED_FOR,
    TOP_FIELDS,
    impossible,
    inverter_problems,
    read_assumed,
    read_variables,
)
from profiles.machine_fields import SAFETY_DEVICES as SAFETY_DEVICES
from profiles.problem import Problem, ProfileError

_AXES = ("tool", "spindle", "carriage")
DAC_BITS = 32_768  # of the full scale of an output of the controller, 16 bits with their sign

MACHINE, SIMULATOR = SIGNED_FOR


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerProfile:
    """The motion controller. `family` is "pmac" or "turbo".

    `background_ms` is the period of its background work (limits, stops). `axis_definitions` are in its own
    language. `variables` holds its settings, such as {"I116": 500}, in the controller's units.
    """

    family: str
    servo_period_ms: float
    background_ms: float
    axis_definitions: tuple[str, ...]
    variables: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolAxis:
    """The linear motor that carries the tool (Tables 2 to 4). Positive is infeed, towards the spindle axis.

    `home_radius_mm` is the radius of the tool tip at motor position zero; travel is measured from there.
    `retract_mm` is the clearance to the surface when the tool is retracted. `wiper_land_mm` is the length of the
    tool's flat: a larger feed per turn leaves a thread. The three gains act on the position error: V/m,
    V/(m s) and V s/m. `damping_n_s_per_m` is the viscous equivalent of all friction (section 4.2).
    `bus_voltage_v` feeds the amplifier, None if unknown. `name` is the name of the tool at the lathe.
    `passive_force_fraction` is the radial force of a cut over the main one; programs make up for it.
    """

    motor: int
    counts_per_mm: float
    moving_mass_kg: float
    damping_n_s_per_m: float
    thrust_constant_n_per_a: float
    amplifier_gain_a_per_v: float
    back_emf_v_s_per_m: float
    coil_resistance_ohm: float
    coil_inductance_h: float
    peak_current_a: float
    peak_force_n: float
    continuous_force_n: float
    encoder_max_velocity_m_per_min: float
    encoder_max_acceleration_m_per_s2: float
    gain_kp_v_per_m: float
    gain_ki_v_per_m_s: float
    gain_kd_v_s_per_m: float
    dac_full_scale_v: float
    home_radius_mm: float
    travel_min_mm: float
    travel_max_mm: float
    retract_mm: float
    wiper_land_mm: float
    bus_voltage_v: float | None = None
    name: str = ""
    notch_n1: float = 0.0
    notch_n2: float = 0.0
    notch_d1: float = 0.0
    notch_d2: float = 0.0
    passive_force_fraction: float = 0.0

    @property
    def v_per_bit(self) -> float:
        """Command voltage of one bit of the controller's output."""
        return self.dac_full_scale_v / DAC_BITS

    @property
    def count_um(self) -> float:
        """Length of one encoder count in um."""
        return 1000 / self.counts_per_mm

    @property
    def loop_gain_n_per_v(self) -> float:
        """Thrust per volt of command: Ka Kt of Eq 9."""
        return self.amplifier_gain_a_per_v * self.thrust_constant_n_per_a


@dataclass(frozen=True, slots=True, kw_only=True)
class Spindle:
    """The spindle with its rotary encoder. Positive is the direction of the cut. Inertia and torque are its own.

    `drive` is "servo", a motor whose loop the controller closes, or "inverter", a conventional spindle that is
    switched and set at the lathe and that the controller only reads. An inverter has `ramp_rpm_per_s`, and
    `slip_rpm` at the peak torque; a servo has neither.
    """

    motor: int
    encoder_lines_per_rev: int
    counts_per_line: int
    max_speed_rpm: float
    inertia_kg_m2: float
    peak_torque_n_m: float
    drive: str = "servo"
    ramp_rpm_per_s: float | None = None
    slip_rpm: float | None = None

    @property
    def followed(self) -> bool:
        """Whether the controller only reads the spindle, which is switched and set at the lathe."""
        return self.drive == "inverter"

    @property
    def counts_per_rev(self) -> int:
        """Counts per turn after interpolation."""
        return self.encoder_lines_per_rev * self.counts_per_line


@dataclass(frozen=True, slots=True, kw_only=True)
class Carriage:
    """The Z axis. Positive is towards the chuck.

    `jaw_face_mm` is the Z position of the jaw faces, measured from Z home; the tool stays `jaw_clearance_mm`
    away from it.
    """

    motor: int
    counts_per_mm: float
    jaw_face_mm: float
    jaw_clearance_mm: float
    travel_min_mm: float
    travel_max_mm: float


SHELL, ONE_LOBE = "shell", "one"


@dataclass(frozen=True, slots=True, kw_only=True)
class Chuck:
    """The chuck. `jaw_mass_kg` is one jaw and `jaw_radius_mm` its centre of mass, for the centrifugal loss.

    `max_force_n` is the total over all jaws. `safety_factor` is S_sp of VDI 3106: what the force at rest is
    divided by before the centrifugal loss is taken from it.

    Data for predictions, None if unknown: the length of the jaws along the axis; the stiffness of one jaw at 1000
    N and the exponent alpha with which it grows, k ~ F^alpha; the friction of the jaws; the fraction of their
    force with which they hold as straight jaws, the rest being even along them, and the length behind their faces
    over which they do not touch; whether the lobe changes along a part as that of a shell, or is one throughout;
    the total force per N m at the wrench, the force at no torque (None beside the first is 0), and its scatter
    between clampings; the lowest
    mode of parts in it. `name` is the name of the chuck at the lathe.

    `OF_CALIBRATION` are no keys of a file: the variance of the wrench line, of the offset (N^2), of both together,
    of the slope; and what a profile has, or else is usual, where a calibration gives length or scatter.
    """

    jaws: int
    jaw_mass_kg: float
    jaw_radius_mm: float
    max_force_n: float
    safety_factor: float
    jaw_length_mm: float | None = None
    jaw_stiffness_n_per_um: float | None = None
    jaw_contact_exponent: float | None = None
    jaw_friction: float | None = None
    jaw_straight_fraction: float | None = None
    jaw_bell_mouth_mm: float | None = None
    lobe_along: str = SHELL
    force_per_torque_n_per_n_m: float | None = None
    force_offset_n: float | None = None
    force_sd_percent: float | None = None
    work_mode_hz: float | None = None
    name: str = ""
    force_line_variance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    uncalibrated_jaw_length_mm: float | None = None
    uncalibrated_force_sd_percent: float | None = None


OF_CALIBRATION = ("force_line_variance", "uncalibrated_jaw_length_mm", "uncalibrated_force_sd_percent")
"""Fields of a chuck that only calibrations fill: its profile has no such keys."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeartbeatPolicy:
    """What the controller does with a cut whose console has fallen silent.

    `policy` is "retract" (the tool retracts at the end of the turn), "finish" or "stop". `grace_ms` is the time
    for a cut to retract its tool by itself before it is aborted; at 1100 a spindle turns at 100 rpm at least.
    """

    policy: str = "retract"
    grace_ms: float = 1100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Safety:
    """The safety devices that protect people: each is "wired", "not fitted" or "unknown".

    Somebody has to sign (`signed_by`) for what is not fitted; with anything unknown a real machine is not
    armed. `signed_for` is "machine" or "simulator", empty without a signature: a profile signed for the
    simulator is refused on a real link. `inputs` lists those that the controller sees, in its language:
    "guard->Y:$FFC2,3=1", the bit and its value in the safe state.
    """

    emergency_stop: str = "unknown"
    safe_torque_off: str = "unknown"
    guard: str = "unknown"
    enabling_device: str = "unknown"
    chuck_closed: str = "unknown"
    key_removed: str = "unknown"
    spindle_permit: str = "unknown"
    signed_by: str = ""
    signed_for: str = ""
    inputs: tuple[str, ...] = ()

    @property
    def devices(self) -> Mapping[str, str]:
        """How each device is fitted, by its name."""
        return {name: getattr(self, name) for name in SAFETY_DEVICES}


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineProfile:
    """One lathe. `assumed` names the dotted keys ("tool.home_radius_mm") that no source or sheet gives.

    `link` is the address of its controller ("ethernet:192.168.0.4"), empty where the command line must give it.
    """

    name: str
    controller: ControllerProfile
    tool: ToolAxis
    spindle: Spindle
    carriage: Carriage
    chuck: Chuck
    assumed: tuple[str, ...] = ()
    source: str = ""
    link: str = ""
    heartbeat: HeartbeatPolicy = field(default_factory=HeartbeatPolicy)
    safety: Safety = field(default_factory=Safety)
    schema: int = 1

    @property
    def motors(self) -> tuple[int, int, int]:
        """The motors of tool, spindle and carriage."""
        return self.tool.motor, self.spindle.motor, self.carriage.motor


def machine_from_table(table: Mapping[str, Any], *, where: str = "") -> MachineProfile:
    """Return the machine in a TOML table, or raise `ProfileError` with every problem of it."""
    if refusal := schema_problem(table, where=where):
        raise ProfileError(refusal)
    known = {**{field.key: field for field in TOP_FIELDS}, **SECTIONS}
    problems = unknown_keys(table, known, where=where)
    top = {key: value for key, value in table.items() if key in known and key not in SECTIONS}
    values, found = read_fields(TOP_FIELDS, top, where=where)
    problems += found
    sections = _read_sections(table, where, problems)
    problems += _crossings(sections, where)
    problems += inverter_problems(sections, where=where)
    problems += signature_gaps(sections, where=where)
    problems += read_assumed(values.get("assumed", ()), where=where)
    if problems:
        raise ProfileError(*problems)
    return MachineProfile(
        controller=ControllerProfile(**sections["controller"]),
        tool=ToolAxis(**sections["tool"]),
        spindle=Spindle(**sections["spindle"]),
        carriage=Carriage(**sections["carriage"]),
        chuck=Chuck(**sections["chuck"]),
        heartbeat=HeartbeatPolicy(**sections.get("heartbeat", {})),
        safety=Safety(**sections.get("safety", {})),
        **values,
    )


def _read_sections(table: Mapping[str, Any], where: str, problems: list[Problem]) -> dict[str, dict[str, Any]]:
    sections: dict[str, dict[str, Any]] = {}
    given: dict[str, Any] | None = None
    for name, fields in SECTIONS.items():
        if name in OPTIONAL_SECTIONS and name not in table:
            continue
        inner = _table(table, name, where, problems)
        if inner is None:
            continue
        if name == "controller":
            given = _table(inner, "variables", where, problems, prefix="controller.")
            inner = {key: value for key, value in inner.items() if key != "variables"}
        sections[name], found = read_fields(fields, inner, where=where, prefix=f"{name}.")
        problems += found
    if given is not None:
        motors = [sections[name].get("motor") for name in _AXES if name in sections]
        variables, found = read_variables(given, [m for m in motors if m is not None], where=where)
        sections["controller"]["variables"] = variables
        problems += found
    return sections


def _table(
    table: Mapping[str, Any], name: str, where: str, problems: list[Problem], prefix: str = ""
) -> dict[str, Any] | None:
    """Return an inner table; report one that is missing or not a table."""
    inner = table.get(name)
    if isinstance(inner, dict):
        return inner
    code, value = ("key.missing", "") if inner is None else ("value.not_table", spell_toml(inner))
    problems.append(Problem(code=code, where=where, key=prefix + name, value=value, limit=f"[{prefix}{name}]"))
    return None


def _crossings(sections: Mapping[str, Mapping[str, Any]], where: str) -> list[Problem]:
    """Return the contradictions that make the machine impossible.

    Reversed travel limits, a shared motor, a force without torque whose line is otherwise unknown.
    """
    problems = []
    chuck, slope = sections.get("chuck", {}), "force_per_torque_n_per_n_m"
    if chuck.get("force_offset_n") is not None and chuck.get(slope) is None:
        problems.append(Problem(code="key.missing", where=where, key=f"chuck.{slope}", limit="force_offset_n"))
    length_mm, open_mm = chuck.get("jaw_length_mm"), chuck.get("jaw_bell_mouth_mm")
    if open_mm and length_mm is None:
        problems.append(
            Problem(code="key.missing", where=where, key="chuck.jaw_length_mm", limit="jaw_bell_mouth_mm")
        )
    elif open_mm and open_mm >= length_mm:
        problems.append(impossible("chuck.jaw_bell_mouth_mm", f"{open_mm:g} mm", f"< {length_mm:g} mm", where))
    for name in ("tool", "carriage"):
        low, high = (sections.get(name, {}).get(f"travel_{end}_mm") for end in ("min", "max"))
        if low is not None and high is not None and low >= high:
            problems.append(impossible(f"{name}.travel_max_mm", f"{high:g} mm", f"> {low:g} mm", where))
    owners: dict[int, str] = {}
    for name in _AXES:
        motor = sections.get(name, {}).get("motor")
        if motor is not None and owners.setdefault(motor, name) != name:
            problems.append(impossible(f"{name}.motor", str(motor), f"≠ {owners[motor]}.motor", where))
    return problems


def is_signature(signed_by: str) -> bool:
    """Whether a text can be a name: it contains a letter, not only marks and blanks."""
    return any(character.isalpha() and not is_blank(character) for character in signed_by)


def signature_gaps(sections: Mapping[str, Mapping[str, Any]], *, where: str) -> list[Problem]:
    """Return the refusal (`safety.nobody_named`, `key.missing`) of a signature without a name or a use."""
    safety = sections.get("safety", {})
    signed_by, key = safety.get("signed_by"), "safety.signed_by"
    if not signed_by:
        return []
    if not is_signature(signed_by):
        return [Problem(code="safety.nobody_named", where=where, key=key, value=spell_toml(signed_by))]
    if safety.get("signed_for") != "":
        return []
    return [Problem(code="key.missing", where=where, key="safety.signed_for", limit=" | ".join(SIGNED_FOR))]


def real_machine_problems(machine: MachineProfile, simulated_by: str = "") -> tuple[Problem, ...]:
    """Return why a profile may not be used on a real link: `safety.signed_for_simulator`.

    A copy of a bundled profile carries its signature along; it must be signed again for the real machine.
    `simulated_by` are the options that lead to the simulated machine instead.
    """
    signed_for, code = machine.safety.signed_for, "safety.signed_for_simulator"
    if signed_for != SIMULATOR:
        return ()
    where, key = machine.name, "safety.signed_for"
    return (Problem(code=code, where=where, key=key, value=signed_for, limit=simulated_by),)
