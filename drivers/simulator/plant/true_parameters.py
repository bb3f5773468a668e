"""The true parameters of the simulated machine, its jaws and its part, as opposed to the profiles' values.

The controller, the planner and the console know the nominal values of the machine profile and of the job. The
simulated hardware has these. Differences are there to be found and learned; by default there are none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from random import Random

import numpy as np

from drivers.lathe_placement import LathePlacement
from drivers.simulator.plant.clamped_shell import ClampedShell
from drivers.simulator.plant.tip_load import material_of
from drivers.simulator.plant.which_lathe import IDEAL, WhichLathe, with_one_lobe
from drivers.simulator.plant.workpiece import OVAL, ROUND, Blank, BlankForm, CutProcess, LobeAlong
from profiles.axis.notch import SignConvention
from profiles.chucking.grip import loss_n
from profiles.job import Job
from profiles.machine import Carriage, MachineProfile, ToolAxis

THIN_WALL = 0.2  # wall over radius below which a part bends as a ring
TIP_OFF_BY_UM = 300  # deviation of the tip from its nominal radius for a tool that was clamped by hand

FRICTION_FOUND_AT_MM_PER_S = 100.0
"""Peak speed of the sine at which dry friction and its viscous equivalent take the same energy: the maximum tool
speed that the controller permits. The paper does not state with which motion its damping was found.
"""

BEYOND_TRAVEL_MM = 3.0  # distance of the mechanical stop of an axis beyond the travel of its profile
COAST_S = 1.5
SPINDLE_FRICTION_N_M = 0.005  # of the bearings: without any it would creep for ever; half a count of lag
JAW_STIFFNESS_N_PER_UM = 50.0  # radial stiffness of a jaw with its guide and its contact, a usual value
JAW_LENGTH_MM = 40.0  # along the axis, a usual value
FEWEST_PLACES, PLACE_MM = 4, 2.0  # on each side of mid-cut, and between two, where the lobe is calculated
LEAST_FRACTION = 0.02  # of the lobe at the jaws that mid-cut needs: near its change of sign any height fits


@dataclass(frozen=True, slots=True, kw_only=True)
class Jaws:
    """The jaws of a chuck holding a ring with `force_n` in all, jaw 1 a fraction `first_harder` above the mean.

    A radial load bends a ring n times a turn by 1 / (n^2 - 1)^2 of it: an oval is softer than any lobe. Loads W_i
    at angles a_i make a harmonic of sum W_i cos n (angle - a_i). With jaw 1 the fraction d above the mean, the
    others below it, and n no multiple of the N jaws, that is W d N / (N - 1) against the N W of the lobe.
    """

    count: int
    force_n: float
    first_harder: float

    @property
    def oval_fraction(self) -> float:
        """Amplitude of the second harmonic over that of the lobe; two jaws make their lobe of it."""
        if self.count == OVAL:
            return 0.0
        softer = (self.count**2 - 1) ** 2 / (OVAL**2 - 1) ** 2
        return self.first_harder / (self.count - 1) * softer

    @property
    def shift_um(self) -> float:
        """The displacement of the whole part off the axis by jaw 1, against the stiffness N k / 2 of the chuck.

        Two opposite jaws are stiff by 2 k along their line, and rigid across it.
        """
        unbalanced_n = self.force_n / self.count * self.first_harder * self.count / (self.count - 1)
        stiffness = JAW_STIFFNESS_N_PER_UM * (self.count if self.count == OVAL else self.count / 2.0)
        return unbalanced_n / stiffness


def ring_overtone(jaws: int) -> float:
    """Return the harmonic of order 2N over the lobe of a ring under N equal radial loads: 0.052 of three jaws.

    Both are highest at the jaws: a load bends a ring n times a turn by 1 / (n^2 - 1)^2 of it, and all multiples
    of N have the same phase.
    """
    return ((jaws**2 - 1) / ((2 * jaws) ** 2 - 1)) ** 2


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueParameters:
    """The true values of one lathe.

    `force_n_per_v` is the thrust for one volt of command, `peak_command_v` the command at which the amplifier
    has reached its peak current. `home_radius_mm` is the radius of the tool tip at the end of its travel,
    `jaw_face_mm` the Z position of the jaw faces, `wiper_land_mm` the length of the tool's flat along Z.
    `damping_n_s_per_m` includes all friction of the tool; `coulomb_friction_n` is the dry part of that (see
    `viscous_n_s_per_m`), which builds up over `presliding_um` (see `Presliding`), or at once. A commutation that
    is `commutation_error_deg` off leaves the cosine of the thrust. The scale of the tool reads up to
    `scale_error_um` wrong, once in each `scale_period_um`, and with a noise of `encoder_noise_um` (rms,
    Gaussian, in each servo cycle); in the cut the tip has a play of `backlash_um` behind it. Its current follows
    the command with `current_lag_s`. Something that bends at
    `flexible_hz`, with the damping ratio `flexible_damping`, adds `flexible_fraction` of the rigid axis'
    acceleration to what scale and tip do (see `FlexibleMode`); 0 is a rigid axis. The controller reads the
    signs of a notch filter by `notch_reading`.

    The cut deflects the tool with `passive_fraction` of the main cutting force, with `edge_n_per_mm` along the
    edge on a chip of no thickness (`profiles.cutting.cutting_force`); 0 is a cut without force on the tool. It
    presses the part away, too: `work_compliance_um_per_n` in the mean, the fraction `softer_between_jaws` less at
    the jaws and more between them. Of the motion of tool and part `process_gain` arrives (see `CutProcess`).

    `jaw_1_deg` is the spindle angle, from the index, at which jaw 1 of the chuck meets the mark at the tool; None
    is a chuck that was mounted as each job says, with jaw 1 at `jaw_offset_deg` after the angle of the job. A part
    springs back by `lobe_factor` times its job's value, or, whatever jobs state, `lobe_um_pp` at a chucking force
    of `lobe_force_n` (None: that of the job's own error); a job without a lobe has none. At another force or speed
    it is in proportion to the force that holds the part at speed, which is less than at rest by the centrifugal
    force of the jaws, each with `jaw_mass_radius_kg_m` of mass times radius. It is high where its job says, or
    `lobe_past_jaw_deg` past the jaws. Jaw 1 presses by the fraction `jaw_1_harder` more than the mean of all jaws.
    Each clamping has its own force, with a standard deviation of the fraction `clamping_force_spread`. The lobe is
    turned by `lobe_turned_deg` past where it would be, by `lobe_turned_deg_per_part` more with each part, and has
    `overtone_factor` of the ring's second harmonic. From the part `jaws_refitted_from_part` on, counted from 1,
    the harder jaw is where jaw 2 was.

    Blanks have an oval of `blank_oval_um_pp` on the radius and run out by `blank_run_out_um` (full indicator
    movement), at angles of their own. With `blank_pressed` 1 they were round before they were clamped, so that the
    jaws press their surface in; with 0 they were turned round in these jaws. From clamping to clamping the machine
    warms up: it brings the tip further in, by `drift_um` in the end, of which 1 - exp(-n / `drift_parts`) after n
    parts.

    Along Z the part is a shell in jaws of `jaw_length_mm` whose surface is `jaw_stiffness` times as stiff as the
    wall, and which press in `jaw_open_fraction` less at their faces (`ClampedShell`); it bends as a beam, too.
    None is a part with one lobe along Z, which does not bend.

    An `ideal_spindle` is at its commanded position; another has inertia, torque, drag and friction. Its encoder
    makes `belt_ratio` turns for one of the spindle: not 1 when it sits on the motor. `slip_rpm` and
    `ramp_rpm_per_s` are of an inverter. Its speed oscillates by the fraction `speed_ripple` about its mean,
    `ripple_per_turn` times a turn, and its axis wanders by `radial_error_um_pp` (peak to peak, see `RadialError`).

    An indicator on the part has `indicator_noise_um` (rms of a reading), `indicator_backlash_um` and
    `indicator_graduation_um`, 0 for none. Finger-tight, a part is held with the fraction `finger_force_fraction`
    of its force, with a standard deviation of `finger_force_spread` of it from clamping to clamping.

    On the gauge a part sits up to `gauge_eccentricity_um` off the axis, each point has a noise of
    `gauge_noise_um` (rms), and where no mark is known the trace begins at a random angle. A known mark is found
    again with a standard deviation of `gauge_mark_sd_deg`, since the part is put on the gauge by hand. Its spindle
    errs by the amplitude `gauge_error_um`, `gauge_error_upr` times a turn, highest at its own `gauge_error_deg`.

    `seed` determines all random effects: the noises, the forces of clampings, the phases of ripple and wander.
    Where `parts_before` were clamped on it, it goes on as after these. `lathe` is which one it is by name. The
    mechanical ends of two axes, `tool_ends_mm` and `carriage_ends_mm`, are from their flags; None is without.

    The starts are the machine's positions at power-up, from its flags and its index, which the controller does not
    know. `coast_s` is the time constant with which the carriage and an ideal spindle coast when their amplifiers
    are disabled.
    """

    moving_mass_kg: float
    damping_n_s_per_m: float
    force_n_per_v: float
    peak_command_v: float
    home_radius_mm: float
    jaw_face_mm: float
    jaw_outer_radius_mm: float
    jaw_mass_radius_kg_m: float
    wiper_land_mm: float
    spindle_inertia_kg_m2: float
    spindle_peak_torque_n_m: float
    spindle_drag_n_m_s_per_rad: float
    spindle_friction_n_m: float = SPINDLE_FRICTION_N_M
    slip_rpm: float = 0.0
    ramp_rpm_per_s: float = 0.0
    ideal_spindle: bool = True
    tool_ends_mm: tuple[float, float] | None = None
    carriage_ends_mm: tuple[float, float] | None = None
    belt_ratio: float = 1.0
    coulomb_friction_n: float = 0.0
    presliding_um: float = 0.0
    current_lag_s: float = 0.0
    encoder_noise_um: float = 0.0
    passive_fraction: float = 0.0
    edge_n_per_mm: float = 0.0
    process_gain: float = 1.0
    work_compliance_um_per_n: float = 0.0
    softer_between_jaws: float = 0.0
    speed_ripple: float = 0.0
    ripple_per_turn: int = 2
    radial_error_um_pp: float = 0.0
    commutation_error_deg: float = 0.0
    scale_error_um: float = 0.0
    backlash_um: float = 0.0
    scale_period_um: float = 20.0
    flexible_hz: float = 300.0
    flexible_damping: float = 0.02
    flexible_fraction: float = 0.0
    notch_reading: SignConvention = SignConvention.STATED
    lobe_factor: float = 1.0
    lobe_um_pp: float | None = None
    lobe_force_n: float | None = None
    lobe_past_jaw_deg: float | None = None
    lobe_turned_deg: float = 0.0
    lobe_turned_deg_per_part: float = 0.0
    overtone_factor: float = 0.0
    blank_oval_um_pp: float = 0.0
    blank_run_out_um: float = 0.0
    blank_pressed: float = 0.0
    drift_um: float = 0.0
    drift_parts: float = 5.0
    jaw_length_mm: float = JAW_LENGTH_MM
    jaw_stiffness: float | None = None
    jaw_open_fraction: float = 0.0
    jaw_offset_deg: float = 0.0
    jaw_1_deg: float | None = None
    jaw_1_harder: float = 0.0
    jaws_refitted_from_part: int | None = None
    clamping_force_spread: float = 0.0
    indicator_noise_um: float = 0.0
    indicator_backlash_um: float = 0.0
    indicator_graduation_um: float = 0.0
    finger_force_fraction: float = 0.0
    finger_force_spread: float = 0.0
    gauge_eccentricity_um: float = 0.0
    gauge_noise_um: float = 0.0
    gauge_mark_known: bool = True
    gauge_mark_sd_deg: float = 0.0
    gauge_error_um: float = 0.0
    gauge_error_upr: int = 2
    gauge_error_deg: float = 0.0
    seed: int = 0
    parts_before: int = 0
    lathe: WhichLathe = field(default=WhichLathe(plant=IDEAL, seed=0, alike=True), compare=False)
    tool_start_mm: float = 1.0
    carriage_start_mm: float = 2.0
    spindle_start_turns: float = 0.3456
    coast_s: float = COAST_S

    def __post_init__(self) -> None:
        """Refuse a friction above the whole damping. Raises ValueError: `coulomb_friction_n` is too large."""
        if self.viscous_n_s_per_m < 0.0:
            most_n = f"{self.most_friction_n:.4g} N"
            raise ValueError(f"coulomb_friction_n = {self.coulomb_friction_n:g} N; all damping is {most_n}")

    @property
    def most_friction_n(self) -> float:
        """The dry friction equivalent to the whole damping."""
        return self.damping_n_s_per_m * math.pi * FRICTION_FOUND_AT_MM_PER_S / 1000.0 / 4.0

    @property
    def viscous_n_s_per_m(self) -> float:
        """The damping of the tool without its dry friction.

        A sine of peak speed V loses as much to a friction F as to a damping of 4 F / (pi V).
        """
        equivalent = 4.0 * self.coulomb_friction_n / (math.pi * FRICTION_FOUND_AT_MM_PER_S / 1000.0)
        return self.damping_n_s_per_m - equivalent

    @property
    def thrust_n_per_v(self) -> float:
        """The thrust for one volt that the commutation leaves."""
        return self.force_n_per_v * math.cos(math.radians(self.commutation_error_deg))

    @property
    def lathes_differ(self) -> bool:
        """Whether the seed draws anything of the lathe itself that no alignment finds.

        These are the phases of the radial error and of the ripple, and where the stylus of the indicator is set.
        """
        return bool(self.radial_error_um_pp or self.speed_ripple or self.gauge_mark_sd_deg)

    @property
    def parts_differ(self) -> bool:
        """Whether any part of this lathe differs from the one before it: clamping, blank, warmth, or readings."""
        return not self.gauge_mark_known or any(
            (
                self.clamping_force_spread,
                self.blank_oval_um_pp,
                self.blank_run_out_um,
                self.drift_um,
                self.lobe_turned_deg_per_part,
                self.jaws_refitted_from_part,
                self.encoder_noise_um,
                self.indicator_noise_um,
                self.finger_force_fraction and self.finger_force_spread,
                self.gauge_eccentricity_um,
                self.gauge_noise_um,
                self.gauge_mark_sd_deg,
            )
        )

    def chance(self, what: str) -> Random:
        """Return the random generator for `what`: the same for the same seed, whatever else is drawn."""
        return Random(f"{self.seed} {what}")

    def chance_of_part(self, what: str) -> Random:
        """Return the same for what takes any number of draws on a part: of its own for each but the first."""
        return self.chance(f"{what} after {self.parts_before} parts" if self.parts_before else what)

    def scale_wrong_mm(self, tool_mm: float) -> float:
        """Return how much further in the tool is than its scale reads, at a place of its travel."""
        return self.scale_error_um / 1000.0 * math.sin(2000.0 * math.pi * tool_mm / self.scale_period_um)

    def blank(self, job: Job, force_factor: float = 1.0, at_rpm: float | None = None, part: int = 1) -> Blank:
        """Return the blank that is clamped for a job, with `force_factor` times the force that it specifies.

        It springs back from the force that is left at the speed of the job, or `at_rpm`. `part` counts those that
        were clamped on this lathe, from 1.
        """
        said_deg = job.jaw_1_deg + self.jaw_offset_deg
        rpm = job.spindle_speed_rpm if at_rpm is None else at_rpm
        lobe_um_pp = self._lobe_um_pp(job, force_factor * job.chucking_force_n, rpm)
        past_deg = job.lobe_past_jaw_deg if self.lobe_past_jaw_deg is None else self.lobe_past_jaw_deg
        jaws = Jaws(count=job.jaws, force_n=force_factor * job.chucking_force_n, first_harder=self.jaw_1_harder)
        turned_deg = self.lobe_turned_deg + (part - 1) * self.lobe_turned_deg_per_part
        refitted = self.jaws_refitted_from_part is not None and part >= self.jaws_refitted_from_part
        return Blank(
            radius_mm=job.radius_mm,
            lobe_um_pp=lobe_um_pp,
            jaws=job.jaws,
            jaw_1_deg=said_deg if self.jaw_1_deg is None else self.jaw_1_deg,
            lobe_past_jaw_deg=(past_deg or 0.0) + turned_deg,
            overtone=self.overtone_factor * ring_overtone(job.jaws),
            shift_um=jaws.shift_um,
            oval_um=jaws.oval_fraction * 0.5 * lobe_um_pp,
            harder_jaw_deg=360.0 / job.jaws if refitted else 0.0,
            pressed_in=self.blank_pressed * _before_cut(job) if self.blank_pressed else 0.0,
            along=self.lobe_along(job),
            middle_mm=self.jaw_face_mm - job.overhang_mm + 0.5 * job.cut_length_mm,
        )

    def press_blank(self, job: Job, force_factor: float, part: int = 1) -> Blank:
        """Return the blank as the jaws press it at rest, before anything was turned off its wall."""
        blank, stiffer = self.blank(job, force_factor, 0.0, part), _before_cut(job)
        return replace(blank, lobe_um_pp=stiffer * blank.lobe_um_pp, oval_um=stiffer * blank.oval_um)

    def finger_factor(self, random: Random) -> float:
        """Draw the force of finger-tight, relative to that of the job; never less than none."""
        if not self.finger_force_fraction:
            return 0.0
        return max(random.gauss(self.finger_force_fraction, self.finger_force_spread), 0.0)

    def _lobe_um_pp(self, job: Job, force_n: float, rpm: float) -> float:
        """Return the spring-back of a part, peak to peak, clamped at rest with `force_n`, turning at `rpm`."""
        found_um_pp, found_n = job.lobe_error_um_pp, job.error_force_n
        if self.lobe_um_pp is not None and job.lobe_error_um_pp:
            found_um_pp, found_n = self.lobe_um_pp, self.lobe_force_n or job.error_force_n
        found_rpm = job.lobe_spindle_speed_rpm or job.spindle_speed_rpm
        then_n = self._held_n(job.jaws, found_n, found_rpm)
        now_n = self._held_n(job.jaws, force_n, rpm)
        return self.lobe_factor * found_um_pp * _lobe_ratio(now_n, then_n)

    def _held_n(self, jaws: int, force_n: float, spindle_speed_rpm: float) -> float:
        """Return the remaining chucking force at speed, N over all jaws; below 0 nothing holds the part."""
        return force_n - loss_n(jaws * self.jaw_mass_radius_kg_m, spindle_speed_rpm)

    def process(self, job: Job, blank: Blank, n_per_mm: float) -> CutProcess:
        """Return how a clamped blank is cut, with `n_per_mm` of passive force per mm of depth."""
        return CutProcess(
            jaws=blank.jaws,
            jaw_1_deg=blank.jaw_1_deg,
            gain=self.process_gain,
            compliance_mm_per_n=self.work_compliance_um_per_n / 1000.0,
            softer_between=self.softer_between_jaws,
            beam_per_n_mm2=self.beam_per_n_mm2(job),
            jaw_face_mm=self.jaw_face_mm,
            n_per_mm=n_per_mm,
        )

    def form(self, random: Random) -> BlankForm:
        """Draw the shape of the next blank's surface: its angles are any."""
        if not self.blank_oval_um_pp and not self.blank_run_out_um:
            return ROUND
        return BlankForm(
            oval_um=0.5 * self.blank_oval_um_pp,
            oval_turns=random.random(),
            off_um=0.5 * self.blank_run_out_um,
            off_turns=random.random(),
        )

    def drifted_mm(self, parts: int) -> float:
        """Return how much further in the warm machine has brought the tip after so many parts."""
        return self.drift_um / 1000.0 * -math.expm1(-parts / self.drift_parts)

    def lobe_along(self, job: Job) -> LobeAlong | None:
        """Return how the lobe changes along the part; None of one lobe along Z, or where mid-cut has none."""
        wall_mm, lobes = job.wall_thickness_mm, job.jaws
        if self.jaw_stiffness is None or wall_mm / job.radius_mm >= THIN_WALL:
            return None
        shell = ClampedShell(
            radius_mm=job.radius_mm - wall_mm / 2.0,
            wall_mm=wall_mm,
            grip_mm=self.jaw_length_mm,
            overhang_mm=job.overhang_mm,
            poisson=material_of(job).poisson,
            jaw_stiffness=self.jaw_stiffness,
            open_fraction=self.jaw_open_fraction,
        )
        harmonics = (lobes, 2 * lobes, *({OVAL} - {lobes}))
        length_mm = min(job.cut_length_mm, job.overhang_mm)
        places = 2 * max(FEWEST_PLACES, math.ceil(length_mm / PLACE_MM / 2.0)) + 1
        z_mm = np.linspace(job.overhang_mm, job.overhang_mm - length_mm, places)
        bent = [shell.pressed(harmonics, job.depth_of_cut_mm, float(z)) for z in z_mm]
        w = np.array(
            [[np.interp(z, each.z_mm, row) for row in each.w] for z, each in zip(z_mm, bent, strict=True)]
        )
        middle, at_jaws = w[places // 2, 0], np.interp(0.0, bent[0].z_mm, bent[0].w[0])
        if abs(middle) < LEAST_FRACTION * abs(at_jaws):
            return None
        of_ring = ((np.square(harmonics) - 1.0) / (lobes**2 - 1.0)) ** 2
        values = w / middle * of_ring
        return LobeAlong(z_mm=self.jaw_face_mm - z_mm, values=dict(zip(harmonics, values.T, strict=True)))

    def beam_per_n_mm2(self, job: Job) -> float:
        """Return 1 / (3 E I) of the part, which bends by that times the cube of its length; 0 is none."""
        if self.jaw_stiffness is None:
            return 0.0
        bore_mm = 2.0 * (job.radius_mm - job.wall_thickness_mm)
        second_mm4 = math.pi / 64.0 * (job.diameter_mm**4 - bore_mm**4)
        return 1.0 / (3.0 * material_of(job).youngs_modulus_n_per_mm2 * second_mm4)

    def force_factor(self, random: Random) -> float:
        """Draw the force of a clamping, relative to the specified one: log-normal, so it is never 0."""
        return math.exp(random.gauss(0.0, self.clamping_force_spread)) if self.clamping_force_spread else 1.0


def ideal(machine: MachineProfile) -> TrueParameters:
    """Return a lathe that equals its profile; spindle and carriage are at their commanded positions."""
    tool, spindle = machine.tool, machine.spindle
    return TrueParameters(
        moving_mass_kg=tool.moving_mass_kg,
        damping_n_s_per_m=tool.damping_n_s_per_m,
        force_n_per_v=tool.loop_gain_n_per_v,
        peak_command_v=tool.peak_current_a / tool.amplifier_gain_a_per_v,
        home_radius_mm=tool.home_radius_mm,
        jaw_face_mm=machine.carriage.jaw_face_mm,
        jaw_length_mm=machine.chuck.uncalibrated_jaw_length_mm or machine.chuck.jaw_length_mm or JAW_LENGTH_MM,
        # The centre of mass of a jaw is assumed at its middle, and its inner end at the spindle axis.
        jaw_outer_radius_mm=2.0 * machine.chuck.jaw_radius_mm,
        jaw_mass_radius_kg_m=machine.chuck.jaw_mass_kg * machine.chuck.jaw_radius_mm / 1000.0,
        wiper_land_mm=tool.wiper_land_mm,
        spindle_inertia_kg_m2=spindle.inertia_kg_m2,
        spindle_peak_torque_n_m=spindle.peak_torque_n_m,
        spindle_drag_n_m_s_per_rad=spindle.inertia_kg_m2 / COAST_S,
        slip_rpm=spindle.slip_rpm or 0.0,
        ramp_rpm_per_s=spindle.ramp_rpm_per_s or 0.0,
    )


def as_simulated(machine: MachineProfile, true: TrueParameters | None) -> MachineProfile:
    """Return the profile for a lathe of this process: with one lobe along Z where its parts have that."""
    if true is not None and true.jaw_stiffness is not None:
        return machine
    return with_one_lobe(machine)


def set_up_by_hand(true: TrueParameters, machine: MachineProfile, random: Random) -> TrueParameters:
    """Return a lathe set up by hand: chuck at any angle, tool tip near its nominal radius, a spindle with inertia.

    An alignment has to find these: the angle in whole hundredths of a degree, the radius in whole um.
    """
    off_by_mm = random.randint(-TIP_OFF_BY_UM, TIP_OFF_BY_UM) / 1000.0
    return replace(
        true,
        ideal_spindle=False,
        tool_ends_mm=_true_position_mm(machine.tool),
        carriage_ends_mm=_true_position_mm(machine.carriage),
        jaw_1_deg=random.randrange(36_000) / 100.0,
        home_radius_mm=round(machine.tool.home_radius_mm + off_by_mm, 3),
    )


def begun_at(true: TrueParameters, placed: LathePlacement) -> TrueParameters:
    """Return a lathe with its axes, jaw 1 and tip where it is placed."""
    if placed.axes is not None:
        tool_mm, carriage_mm, turns = placed.axes
        true = replace(true, tool_start_mm=tool_mm, carriage_start_mm=carriage_mm, spindle_start_turns=turns % 1.0)
    if placed.jaw_1_deg is not None:
        true = replace(true, jaw_1_deg=placed.jaw_1_deg)
    return true if placed.tip_radius_mm is None else replace(true, home_radius_mm=placed.tip_radius_mm)


def _before_cut(job: Job) -> float:
    """Return by what fraction of the bending of the finished part its blank bends.

    A ring bends by 1 / t^3 of its wall t; one whose wall is thick is no ring, and hardly changes.
    """
    wall_mm = job.wall_thickness_mm
    if wall_mm / job.radius_mm >= THIN_WALL:
        return 1.0
    return (1.0 - job.depth_of_cut_mm / wall_mm) ** 3


def _lobe_ratio(now_n: float, then_n: float) -> float:
    """Return the factor of the lobe at another holding force; at the force of its measurement it is exactly 1.

    A part that nothing holds is not bent: 0, and so it is where the error was measured without a force.
    """
    if now_n == then_n:
        return 1.0
    return max(now_n, 0.0) / then_n if then_n > 0.0 else 0.0


def _true_position_mm(axis: ToolAxis | Carriage) -> tuple[float, float]:
    """Return the mechanical ends: slightly beyond the permitted travel."""
    return (axis.travel_min_mm - BEYOND_TRAVEL_MM, axis.travel_max_mm + BEYOND_TRAVEL_MM)
