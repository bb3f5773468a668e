"""What the simulated machine and the part in its chuck really are, beside what the profiles say of them.

The controller, the planner and the console know the nominal values of the machine profile and of the job. The
iron has these. Where they differ there is something to find and to learn; by default they do not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from random import Random

from drivers.simulator.plant.workpiece import Blank
from profiles.job import Job
from profiles.machine import MachineProfile

TIP_OFF_BY_UM = 300
"""How far from its nominal radius the tip of a tool may stand that was clamped by hand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueParameters:
    """The true values of one lathe.

    `force_n_per_v` is the thrust for one volt of command, `peak_command_v` the command at which the amplifier
    has reached its peak current. `home_radius_mm` is the radius of the tool tip at the end of its travel,
    `jaw_face_mm` the Z position of the jaw faces, `wiper_land_mm` the length of the tool's flat along Z.

    `jaw_1_deg` is the spindle angle, from the index, at which jaw 1 of the chuck meets the mark at the tool; None
    is a chuck that was mounted as each job says. A part springs back by `lobe_factor` times what its job says;
    without a `jaw_1_deg`, jaw 1 is at `jaw_offset_deg` behind the angle that the job gives.

    The starts are where the machine was left standing, from its flags and its index: power-up tells the card
    nothing about it. `coast_s` is the time constant with which spindle and carriage run out when their
    amplifiers are switched off.
    """

    moving_mass_kg: float
    damping_n_s_per_m: float
    force_n_per_v: float
    peak_command_v: float
    home_radius_mm: float
    jaw_face_mm: float
    wiper_land_mm: float
    lobe_factor: float = 1.0
    jaw_offset_deg: float = 0.0
    jaw_1_deg: float | None = None
    tool_start_mm: float = 1.0
    carriage_start_mm: float = 2.0
    spindle_start_turns: float = 0.3456
    coast_s: float = 1.5

    def blank(self, job: Job) -> Blank:
        """Return the blank that is clamped for a job."""
        said_deg = job.lobe_phase_deg + self.jaw_offset_deg
        return Blank(
            radius_mm=job.radius_mm,
            lobe_um_pp=self.lobe_factor * job.lobe_error_um_pp,
            jaws=job.jaws,
            jaw_1_deg=said_deg if self.jaw_1_deg is None else self.jaw_1_deg,
        )


def ideal(machine: MachineProfile) -> TrueParameters:
    """Return a lathe that is what its profile says."""
    tool = machine.tool
    return TrueParameters(
        moving_mass_kg=tool.moving_mass_kg,
        damping_n_s_per_m=tool.damping_n_s_per_m,
        force_n_per_v=tool.loop_gain_n_per_v,
        peak_command_v=tool.peak_current_a / tool.amplifier_gain_a_per_v,
        home_radius_mm=tool.home_radius_mm,
        jaw_face_mm=machine.carriage.jaw_face_mm,
        wiper_land_mm=tool.wiper_land_mm,
    )


def as_mounted(machine: MachineProfile, random: Random) -> TrueParameters:
    """Return an ideal lathe set up by hand: chuck at any angle, tool tip near its nominal radius.

    That is what an alignment has to find: the angle in whole hundredths of a degree, the radius in whole um.
    """
    off_by_mm = random.randint(-TIP_OFF_BY_UM, TIP_OFF_BY_UM) / 1000.0
    return replace(
        ideal(machine),
        jaw_1_deg=random.randrange(36_000) / 100.0,
        home_radius_mm=round(machine.tool.home_radius_mm + off_by_mm, 3),
    )
