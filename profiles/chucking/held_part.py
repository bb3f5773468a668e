"""One part in its chuck under its cut: its roundness error and its deflection.

A thin part (wall below a fifth of the radius) springs back and deflects between the jaws; a bar rests in contacts
that stiffen with load, and bends as a cantilever. Angles are from jaw 1, in degrees; Z is from the jaw faces, in
mm, positive towards the free end; deviations of the released part are in um, positive where it is high.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Floats, floats
from profiles.chucking.contact import MINDLIN_RATIO, Contact, cantilever_um, overhung_deflection, stiffness_at
from profiles.chucking.diagnosis import Mechanism
from profiles.chucking.grip import centrifugal_loss_n
from profiles.chucking.holding import REFERENCE_FORCE_N, Holding, holding_of
from profiles.chucking.ring import is_thin
from profiles.chucking.tube import Tube, half_lobe_deg, spring_back_um, wall_compliance_um_per_n
from profiles.cutting import CuttingForce, cutting_force
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.materials import Material, material_named

BAR_DAMPING, WALL_DAMPING = 0.03, 0.02  # usual damping ratios of a bar in a chuck and of a thin wall
_TURN_DEG = np.arange(0.0, 360.0, 5.0)


@dataclass(frozen=True, kw_only=True)
class HeldPart:
    """A job in the jaws of a machine. `per_jaw_n` is the force on one jaw at speed."""

    job: Job
    material: Material
    holding: Holding
    force: CuttingForce
    per_jaw_n: float

    @property
    def thin(self) -> bool:
        """Whether the part bends as a ring."""
        return is_thin(self.job.wall_thickness_mm, self.job.radius_mm)

    @property
    def tube(self) -> Tube:
        """The part as a tube that ends in the jaws."""
        return Tube(
            outside_mm=self.job.diameter_mm,
            wall_mm=self.job.wall_thickness_mm,
            grip_mm=self.holding.jaw_length_mm,
            straight_fraction=self.holding.straight_fraction,
            bell_mouth_mm=self.holding.bell_mouth_mm,
            overhang_mm=self.job.overhang_mm,
            material=self.material,
        )

    @cached_property
    def contact(self) -> Contact:
        """The jaw contacts at the clamping force at speed."""
        alpha = self.holding.contact_exponent
        return Contact(
            jaws=self.job.jaws,
            stiffness_n_per_um=stiffness_at(
                self.holding.stiffness_n_per_um, REFERENCE_FORCE_N, self.per_jaw_n, alpha
            ),
            force_per_jaw_n=self.per_jaw_n,
            alpha=alpha,
            # Three jaws and more hold every direction by normal force; two hold sideways by friction alone.
            tangential_ratio=MINDLIN_RATIO if self.job.jaws == 2 else 0.0,
        )

    def turned_down(self, depth_mm: float) -> HeldPart:
        """Return the part after a cut of this depth on the radius, at the same force."""
        smaller = replace(
            self.job,
            diameter_mm=self.job.diameter_mm - 2 * depth_mm,
            wall_thickness_mm=self.job.wall_thickness_mm - depth_mm,
        )
        return replace(self, job=smaller)

    def error_parts_um(self, angle_deg: Floats, z_mm: Floats) -> dict[Mechanism, Floats]:
        """Return the deviation that each mechanism leaves, shape (Z, angle), mean 0 over a turn."""
        if not self.thin:
            return {Mechanism.CONTACT: _subtract_mean(self._bar_um(angle_deg, z_mm)[0])}
        tube, jaws = self.tube, self.job.jaws
        sprung = self._sprung_um(angle_deg, z_mm)
        wall = self.force.passive_n * wall_compliance_um_per_n(tube, jaws, angle_deg, z_mm)
        return {Mechanism.SPRING_BACK: sprung, Mechanism.WALL: _subtract_mean(wall)}

    def _sprung_um(self, angle_deg: Floats, z_mm: Floats) -> Floats:
        """Return the spring-back from what was pressed in when the tool was there; behind the cut, at its end.

        The wall becomes thinner from the free end on. That is taken at the two ends of the cut and in its middle.
        """
        end_mm, length_mm = self.job.overhang_mm, min(self.job.cut_length_mm, self.job.overhang_mm)
        done = np.clip((end_mm - z_mm) / length_mm, 0.0, 1.0)
        weights = (1 - done) * (1 - 2 * done), 4 * done * (1 - done), done * (2 * done - 1)
        sprung = np.zeros((z_mm.size, angle_deg.size))
        for cut_mm, weight in zip(length_mm * np.array([0.0, 0.5, 1.0]), weights, strict=True):
            if weight.any():
                tube = replace(
                    self.tube, turned_mm=self.job.depth_of_cut_mm, turned_from_mm=float(end_mm - cut_mm)
                )
                sprung += weight[:, None] * spring_back_um(
                    tube, self.job.jaws, self.per_jaw_n, angle_from_jaw_deg=angle_deg, z_mm=z_mm
                )
        return sprung

    def error_um_pp(self, z_mm: float) -> float:
        """Return the peak-to-peak deviation of all mechanisms together at one Z; half a lobe suffices."""
        angle_deg, z = half_lobe_deg(self.job.jaws), np.array([z_mm])
        if not self.thin:
            return float(np.ptp(self._bar_um(angle_deg, z)[0]))
        return float(np.ptp(np.sum(list(self.error_parts_um(angle_deg, z).values()), axis=0)))

    def size_um(self, z_mm: Floats) -> Floats:
        """Return how much too large the radius is, shape (Z,): what deflects is not cut."""
        if self.thin:
            compliance = wall_compliance_um_per_n(self.tube, self.job.jaws, _TURN_DEG, z_mm)
            return floats(self.force.passive_n * compliance.mean(axis=1))
        bore_mm = self.job.diameter_mm - 2 * self.job.wall_thickness_mm
        bent = cantilever_um(self.material, self.job.diameter_mm, z_mm, self.force.passive_n, bore_mm=bore_mm)
        return np.asarray(self._bar_um(_TURN_DEG, z_mm)[0].mean(axis=1) + bent)

    def lifted(self) -> bool:
        """Whether a jaw edge loses contact with a bar under the cut at the free end."""
        return not self.thin and bool(self._bar_um(_TURN_DEG, np.array([self.job.overhang_mm]))[1].any())

    @cached_property
    def compliance_um_per_n(self) -> float:
        """Return the radial compliance of the part, mean over a turn, at the free end."""
        return float(self.size_um(np.array([self.job.overhang_mm]))[0]) / self.force.passive_n

    @property
    def softest_n_per_um(self) -> float:
        """The minimum stiffness of the part."""
        if self.thin:
            angle_deg, end_mm = half_lobe_deg(self.job.jaws), [self.job.overhang_mm]
            return 1 / float(wall_compliance_um_per_n(self.tube, self.job.jaws, angle_deg, end_mm).max())
        return 1 / self.compliance_um_per_n

    @property
    def damping_ratio(self) -> float:
        """Damping ratio of the part in its chuck."""
        return WALL_DAMPING if self.thin else BAR_DAMPING

    def _bar_um(self, angle_deg: Floats, z_mm: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Return how far a bar deflects from a tool at (Z, angle), and where a jaw edge loses contact.

        A tool at an angle pushes towards the opposite side.
        """
        moved, lifted = [], []
        for z in z_mm:
            lever = float(z) / self.holding.jaw_length_mm
            found = overhung_deflection(self.contact, lever, self.force.passive_n, angle_deg + 180.0)
            moved.append(found.along_um)
            lifted.append(found.lifted)
        return np.stack(moved), np.stack(lifted)


def held_part(job: Job, machine: MachineProfile) -> HeldPart:
    """Return the part in the jaws at speed, under its cut. Raises `ProfileError` (`rule.material_unknown`)."""
    material = material_named(job.material)
    return HeldPart(
        job=job,
        material=material,
        holding=holding_of(machine),
        force=cutting_force(material, job.depth_of_cut_mm, job.feed_mm_per_rev),
        per_jaw_n=(job.chucking_force_n - centrifugal_loss_n(job, machine)) / job.jaws,
    )


def _subtract_mean(values: Floats) -> Floats:
    return floats(values - values.mean(axis=1, keepdims=True))
