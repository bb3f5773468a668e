"""The workpiece in the chuck: the surface that the tool leaves, and its shape after release.

While it is clamped the jaws press the ring in and the tool cuts it round (or as the tool moves); released, it
springs back and is high where the jaws were (Fig. 14 of the paper; ring under equal radial loads). The tool has a
flat parallel to Z, so that successive turns overlap and leave no feed marks in a section.

The passive force presses the part away from the tool, between the jaws further than at them: with the compliance
c and k newtons for each mm that is cut, a tip at the depth d cuts d / (1 + c k), and leaves the rest. Of the
motion of tip and work against each other about its mean, only the process gain is found in the surface.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from profiles.job import Job

Floats = NDArray[np.float64]
OVAL = 2
ANGLES = 3600  # points of a section, equally spaced from the spindle index

# Angles round the part at which it is roughly known all along; no spindle skips one of them in a servo cycle.
ROUGH_PLACES = 24
# Least length of such a place along Z, never below the land: a tool that feeds a land per turn reaches each place.
ROUGH_LENGTH_MM = 0.5
CHUNK = 4096  # samples of a path that are best processed at once
REACH = 2  # samples that the interpolation needs on either side of an interval
OVERLAP = 2 * REACH + 1  # samples kept from one chunk to the next: every interval is processed once
EDGE_MM = 1e-6  # rounding of Z: a feed of exactly the land per turn must leave no gap between two turns


@dataclass(frozen=True, slots=True, kw_only=True)
class BlankForm:
    """Deviations of a blank's surface on the radius, highest at these turns of the spindle from its index.

    `oval_um` is the amplitude of its second harmonic, `off_um` how far its surface is off the axis: half of the
    full indicator movement.
    """

    oval_um: float = 0.0
    oval_turns: float = 0.0
    off_um: float = 0.0
    off_turns: float = 0.0

    @property
    def most_mm(self) -> float:
        """A deviation that no point exceeds."""
        return (self.oval_um + self.off_um) / 1000.0

    def at_mm(self, turns: float | Floats) -> Floats:
        """Return how much further out the surface is."""
        angle = 2.0 * math.pi * np.asarray(turns, dtype=np.float64)
        oval = self.oval_um * np.cos(2.0 * (angle - 2.0 * math.pi * self.oval_turns))
        off = self.off_um * np.cos(angle - 2.0 * math.pi * self.off_turns)
        return np.asarray((oval + off) / 1000.0, dtype=np.float64)


ROUND = BlankForm()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LobeAlong:
    """Each harmonic of a blank along Z while the tool is there, over what a ring has beside the lobe mid-cut.

    `z_mm` are places of the machine, upwards, and so are the values of each harmonic.
    """

    z_mm: Floats
    values: Mapping[int, Floats]

    def at(self, harmonic: int, z_mm: float) -> float:
        """Return the value of a harmonic at a Z; behind the cut it is that at its end."""
        return float(np.interp(z_mm, self.z_mm, self.values[harmonic]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Blank:
    """The true shape of a clamped blank that was turned round before (see `TrueParameters.blank`).

    `lobe_um_pp` is the spring-back of the free part, high at the jaws or `lobe_past_jaw_deg` past them, and
    `jaw_1_deg` the spindle angle of jaw 1. Unequal jaws add `oval_um` twice a turn and `shift_um` once, both
    amplitudes that are highest at the harder jaw, `harder_jaw_deg` past jaw 1. Its second harmonic is the fraction
    `overtone` of the lobe. All of it is that at the Z `middle_mm`, and elsewhere as `along` has it; None is one
    lobe along Z. `form` is the shape of the surface that was never cut.

    A blank that was round before it was clamped is pressed in where the part will spring back, by the fraction
    `pressed_in` of that; 0 is one that was turned round in these jaws.
    """

    radius_mm: float
    lobe_um_pp: float
    jaws: int
    jaw_1_deg: float
    lobe_past_jaw_deg: float = 0.0
    shift_um: float = 0.0
    oval_um: float = 0.0
    harder_jaw_deg: float = 0.0
    along: LobeAlong | None = None
    middle_mm: float = 0.0
    overtone: float = 0.0
    form: BlankForm = ROUND
    pressed_in: float = 0.0

    @property
    def most_radius_mm(self) -> float:
        """A radius that no point of the surface exceeds."""
        most = 1.0 if self.along is None else max(float(np.abs(each).max()) for each in self.along.values.values())
        lobe_um = most * (0.5 * self.lobe_um_pp * (1.0 + self.overtone) + abs(self.oval_um)) + abs(self.shift_um)
        return self.radius_mm + self.form.most_mm + self.pressed_in * lobe_um / 1000.0

    def radius_at_mm(self, turns: float) -> float:
        """Return the clamped radius before any cut, `turns` of the spindle from its index."""
        if self.form is ROUND and not self.pressed_in:
            return self.radius_mm
        return self.radius_mm + float(self.surface_mm(np.asarray(turns, dtype=np.float64)))

    def surface_mm(self, turns: Floats, z_mm: float | None = None) -> Floats:
        """Return how much further out than its radius the clamped surface is before any cut, at these turns.

        It is that at a Z of the machine, by default in the middle of the cut.
        """
        own_mm = self.form.at_mm(turns)
        if not self.pressed_in:
            return own_mm
        there_mm = self.middle_mm if z_mm is None else z_mm
        return own_mm - self.pressed_in / 1000.0 * self.spring_back_um(360.0 * turns, there_mm)

    def spring_back_um(self, angle_deg: Floats, z_mm: float) -> Floats:
        """Return how much further out the released surface is than the clamped one, at a Z of the machine."""
        past_jaw = np.radians(angle_deg - self.jaw_1_deg)
        lobes, phase = self.jaws, self.jaws * (past_jaw - math.radians(self.lobe_past_jaw_deg))
        half_um, past_harder = 0.5 * self.lobe_um_pp, past_jaw - math.radians(self.harder_jaw_deg)
        sprung = self._along(lobes, z_mm) * half_um * np.cos(phase)
        if self.overtone:
            sprung = sprung + self._along(2 * lobes, z_mm) * self.overtone * half_um * np.cos(2.0 * phase)
        if self.oval_um:
            sprung = sprung + self._along(OVAL, z_mm) * self.oval_um * np.cos(2.0 * past_harder)
        return np.asarray(sprung + self.shift_um * np.cos(past_harder), dtype=np.float64)

    def _along(self, harmonic: int, z_mm: float) -> float:
        return 1.0 if self.along is None else self.along.at(harmonic, z_mm)

    def expected_um(self, job: Job, angle_deg: Floats) -> Floats:
        """Return the lobe that its job expects, um outwards."""
        past_lobe = np.radians(angle_deg - self.jaw_1_deg - (job.lobe_past_jaw_deg or 0.0))
        return np.asarray(job.lobe_amplitude_um * np.cos(job.jaws * past_lobe), dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class CutProcess:
    """How one clamped part is cut.

    `gain` is the fraction of the motion that arrives. The part gives way by `compliance_mm_per_n` in the mean, by
    the fraction `softer_between` less at the jaws and more between them, and bends by `beam_per_n_mm2` times the
    cube of its length in front of `jaw_face_mm`, to a passive force of `n_per_mm` for each mm of depth.
    """

    jaws: int = 3
    jaw_1_deg: float = 0.0
    gain: float = 1.0
    compliance_mm_per_n: float = 0.0
    softer_between: float = 0.0
    beam_per_n_mm2: float = 0.0
    jaw_face_mm: float = 0.0
    n_per_mm: float = 0.0

    @property
    def yields(self) -> bool:
        """Whether the part gives way to the cut."""
        return (self.compliance_mm_per_n + self.beam_per_n_mm2) * self.n_per_mm > 0.0

    def compliance_at(self, turns: Floats) -> Floats:
        """Return the compliance before the tool, mm/N, at these turns of the spindle from its index."""
        past_jaw = 2.0 * math.pi * turns - math.radians(self.jaw_1_deg)
        softer = 1.0 - self.softer_between * np.cos(self.jaws * past_jaw)
        return np.asarray(self.compliance_mm_per_n * softer, dtype=np.float64)

    def compliances(self, places: int) -> tuple[float, ...]:
        """Return the compliance in so many places from the spindle index; nothing of a part that is rigid."""
        return tuple(self.compliance_at((np.arange(places) + 0.5) / places).tolist()) if self.yields else ()

    def left_mm(self, turns: Floats, depth_mm: Floats, z_mm: float) -> Floats:
        """Return how much of the depth from the surface to the tip is not cut, because the part gives way."""
        bent = self.beam_per_n_mm2 * max(self.jaw_face_mm - z_mm, 0.0) ** 3
        given = (self.compliance_at(turns) + bent) * self.n_per_mm
        return np.asarray(np.maximum(depth_mm, 0.0) * given / (1.0 + given), dtype=np.float64)

    def arrived_mm(self, radius_mm: Floats, cut: NDArray[np.bool_]) -> Floats:
        """Return the surface where it was `cut` to `radius_mm`, all round; elsewhere it is as it was."""
        if self.gain == 1.0 or not cut.any():
            return radius_mm
        mean_mm = float(radius_mm[cut].mean())
        return np.where(cut, mean_mm + self.gain * (radius_mm - mean_mm), radius_mm)


ALL_ARRIVES = CutProcess()


class Workpiece:
    """Sections of a part, each the least radius that the tool has reached, all round."""

    def __init__(
        self, blank: Blank, sections_mm: Sequence[float], land_mm: float, process: CutProcess = ALL_ARRIVES
    ) -> None:
        """`sections_mm` are Z positions of the machine, `land_mm` the length of the tool's flat along Z."""
        self.blank, self._process = blank, process
        self._sections_mm = tuple(sections_mm)
        self._land_mm = land_mm
        self._rough_length_mm = max(land_mm, ROUGH_LENGTH_MM)
        self._rough_mm: dict[int, Floats] = {}
        self._radius_mm = np.full((len(self._sections_mm), ANGLES), blank.radius_mm)
        self._rough_blank_mm = np.full(ROUGH_PLACES, blank.radius_mm)
        if blank.form is not ROUND or blank.pressed_in:
            turns = np.arange(ANGLES) / ANGLES
            for surface_mm, z_mm in zip(self._radius_mm, self._sections_mm, strict=True):
                surface_mm += blank.surface_mm(turns, z_mm)
            self._rough_blank_mm += blank.surface_mm((np.arange(ROUGH_PLACES) + 0.5) / ROUGH_PLACES)
        # What was there before the tool came: of its depth a part that gives way leaves some.
        self._blank_mm: Floats = self._radius_mm.copy()
        self._before_mm = list(self._blank_mm)
        self._tail: Floats = np.empty((3, 0))

    def cut(
        self, radius_mm: Sequence[float] | Floats, turns: Sequence[float] | Floats, z_mm: Sequence[float] | Floats
    ) -> None:
        """Let the tool tip pass: radius, spindle turns since the index and Z, one servo cycle apart.

        The surface does not depend on how the path is divided into calls.
        """
        samples = np.concatenate(
            [self._tail, np.stack([np.asarray(each) for each in (radius_mm, turns, z_mm)])], axis=1
        )
        self._tail = samples[:, -OVERLAP:]
        self._turn_down(samples)
        if samples.shape[1] > OVERLAP:
            for section in range(len(self._sections_mm)):
                self._pass(section, samples)

    def released_um(self, section: int, nominal_radius_mm: float) -> tuple[Floats, Floats]:
        """Return angles (deg, from the spindle index) and deviations (um, outward) of a section when free."""
        angle_deg: Floats = np.arange(ANGLES, dtype=np.float64) * (360.0 / ANGLES)
        spring_back_um = self.blank.spring_back_um(angle_deg, self._sections_mm[section])
        return angle_deg, self.clamped_um(section, nominal_radius_mm) + spring_back_um

    def clamped_um(self, section: int, nominal_radius_mm: float) -> Floats:
        """Return the deviations (um, outward) of a section while it is clamped, from the spindle index on."""
        radius_mm = self._radius_mm[section]
        arrived_mm = self._process.arrived_mm(radius_mm, radius_mm < self._blank_mm[section])
        clamped_um: Floats = (arrived_mm - nominal_radius_mm) * 1000.0
        return clamped_um

    def clamped_radius_mm(self, turns: float, z_mm: float) -> float:
        """Return approximately how far out the clamped surface is before the tool, anywhere along the part.

        A blank is known exactly; where it was cut, the least radius within 15 deg and a land of the tool.
        """
        rough_mm = self._rough_mm.get(math.floor(z_mm / self._rough_length_mm))
        if rough_mm is None:
            return self.blank.radius_at_mm(turns)
        return float(rough_mm[math.floor(turns * ROUGH_PLACES) % ROUGH_PLACES])

    def followed_um(self, job: Job, off_um: Floats) -> Floats:
        """Return what a tool that does exactly the lobe of a job leaves in the middle of the cut, um outwards.

        `off_um` is by how much the work comes nearer than its path, all round.
        """
        blank, angle_deg = self.blank, np.arange(ANGLES, dtype=np.float64) * (360.0 / ANGLES)
        tip_mm = job.finished_radius_mm - (blank.expected_um(job, angle_deg) + off_um) / 1000.0
        tip_mm += self._process.left_mm(angle_deg / 360.0, self._blank_mm[0] - tip_mm, blank.middle_mm)
        arrived_mm = self._process.arrived_mm(tip_mm, np.ones(ANGLES, dtype=np.bool_))
        left_mm = arrived_mm - job.finished_radius_mm
        return np.asarray(1000.0 * left_mm + blank.spring_back_um(angle_deg, blank.middle_mm), dtype=np.float64)

    def mean_radius_mm(self, z_mm: float) -> float:
        """Return the mean radius of the clamped surface at a Z, as `clamped_radius_mm` knows it."""
        rough_mm = self._rough_mm.get(math.floor(z_mm / self._rough_length_mm), self._rough_blank_mm)
        return float(np.mean(rough_mm))

    def _turn_down(self, samples: Floats) -> None:
        """Lower the rough surface to the tool at every sample in which the spindle turned."""
        cutting = (np.diff(samples[1], prepend=samples[1, :1]) > 0.0) & (samples[0] < self.blank.most_radius_mm)
        if not cutting.any():
            return
        radius_mm, turns, z_mm = samples[:, cutting]
        places = np.mod(np.floor(turns * ROUGH_PLACES).astype(np.int64), ROUGH_PLACES)
        lengths = np.floor(z_mm / self._rough_length_mm).astype(np.int64)
        for length in np.unique(lengths).tolist():
            here = lengths == length
            if length not in self._rough_mm:
                self._rough_mm[length] = self._rough_blank_mm.copy()
            np.minimum.at(self._rough_mm[length], places[here], radius_mm[here])

    def _pass(self, section: int, samples: Floats) -> None:
        """Lower a section to the tool wherever its land passed, including between the samples."""
        away_mm, reach_mm = samples[2] - self._sections_mm[section], 0.5 * self._land_mm + EDGE_MM
        near = (np.minimum(away_mm[:-1], away_mm[1:]) <= reach_mm) & (
            np.maximum(away_mm[:-1], away_mm[1:]) >= -reach_mm
        )
        if not near.any():
            return
        visits = (0, *self._arrivals(samples[0], near), near.size)
        for first, end in pairwise(visits):
            if first:
                self._before_mm[section] = self._radius_mm[section].copy()
            visit = near.copy()
            visit[:first] = visit[end:] = False
            self._lower(section, samples, away_mm, reach_mm, visit)

    def _arrivals(self, radius_mm: Floats, near: NDArray[np.bool_]) -> list[int]:
        """Return the intervals, of the block being processed, in which the tool returns to a section."""
        if not self._process.yields:
            return []
        there = near & (np.minimum(radius_mm[:-1], radius_mm[1:]) < self.blank.most_radius_mm)
        came = np.flatnonzero(there[1:] & ~there[:-1]) + 1
        return [at for at in came.tolist() if REACH <= at < near.size - REACH]

    def _lower(
        self, section: int, samples: Floats, away_mm: Floats, reach_mm: float, near: NDArray[np.bool_]
    ) -> None:
        """Lower a section to the tool in the intervals `near` it."""
        radius_mm, turns, _ = samples
        surface_mm = self._radius_mm[section]
        if radius_mm.min() >= surface_mm.max():
            return
        index, grid, u = _whole_places(turns * ANGLES, near)
        # Of an interval in which the land comes or goes, only the part inside it cuts.
        inside = np.abs(away_mm[index] + u * (away_mm[index + 1] - away_mm[index])) <= reach_mm
        radius = _cubic(radius_mm, index[inside], u[inside])
        places = np.mod(grid[inside], ANGLES)
        if self._process.yields:
            depth_mm = self._before_mm[section][places] - radius
            radius += self._process.left_mm(places / ANGLES, depth_mm, self._sections_mm[section])
        np.minimum.at(surface_mm, places, radius)


def _whole_places(
    places: Floats, target: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Return every integer place in the selected intervals: its interval, itself and its fraction (0 to 1)."""
    steps = np.diff(places)
    inner = np.arange(REACH, len(steps) - REACH)
    start = inner[(steps[inner] > 0.0) & target[inner]]
    first = np.ceil(places[start]).astype(np.int64)
    counts = np.maximum(np.ceil(places[start + 1]).astype(np.int64) - first, 0)
    index = np.repeat(start, counts)
    offsets = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    grid = np.repeat(first, counts) + offsets
    return index, grid, (grid - places[index]) / steps[index]


def _cubic(values: Floats, index: NDArray[np.int64], u: Floats) -> Floats:
    """Interpolate in the intervals `index` by a cubic with slopes from five samples.

    A sampled 150 Hz motion would lose half a micrometre to straight lines, and some hundredths to slopes from
    three samples; the tool itself moves smoothly.
    """
    slopes = np.zeros_like(values)
    slopes[2:-2] = (8.0 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) / 12.0
    p0, p1, m0, m1 = values[index], values[index + 1], slopes[index], slopes[index + 1]
    cubic = (2 * (p0 - p1) + m0 + m1) * u + (3 * (p1 - p0) - 2 * m0 - m1)
    interpolated: Floats = (cubic * u + m0) * u + p0
    return interpolated
