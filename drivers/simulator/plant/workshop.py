"""Events at the chuck of the simulated lathe: a part is clamped, cut, collided with, viewed and measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from drivers.simulator.plant.collision import CollisionWatch, Track, clamp_job_blank
from drivers.simulator.plant.dials import AtTheChuck
from drivers.simulator.plant.drives import Drives
from drivers.simulator.plant.spindle import RadialError
from drivers.simulator.plant.tip_load import CELLS, Stock, cutting_torque_n_m, material_of
from drivers.simulator.plant.true_parameters import TrueParameters
from drivers.simulator.plant.which_lathe import LATHE
from drivers.simulator.plant.workpiece import ANGLES, CHUNK, OVERLAP, Blank, Workpiece
from drivers.simulator.plant.workshop_view import Truth, WorkshopView
from profiles.compensations.trial_band import BandReadings
from profiles.fingerprint.readings import ClampReadings
from profiles.job import NO_LOBE, Job
from profiles.lobe.lobe_origin import with_modelled_lobe
from profiles.machine import MachineProfile
from profiles.metrology.cylindricity import PartSection
from profiles.problem import ProfileError
from profiles.roundness import evaluate
from profiles.traces import Trace

SECTIONS = (0.0, *(side * each / 20 for each in range(1, 10) for side in (-1, 1)))
"""Where the surface is kept, cut lengths past the middle of the cut, towards the jaws: over nine tenths of it."""
MEASURED = (0.4, 0.2, 0.0, -0.2, -0.4)  # where the gauge takes sections, in the same measure
MID_LENGTH = 0
SAME_PLACE_MM = 1e-6
LEAST_TIMES = 2  # how often a block that repeats itself is processed
Floats = NDArray[np.float64]
JAWS = 3  # of a chuck that has not held a part yet
FREE = "free"  # off the lathe, and put on the gauge by hand
LEAST_PLACES, PLACES_A_LOBE = 16, 5  # enough for the second harmonic of the lobe, too
FORCE_DIGITS = 10  # N: to that a hand would state the force of finger-tight

Surface = Callable[[float], float]
"""How far out the clamped surface is, um, at an angle of the part from the spindle index, deg."""
FAR_MM = 0.5  # much more than the tip moves in some servo cycles: a cubic through such places stays outside
ROUNDING_MM = 1e-6
Block = tuple[Sequence[float], Sequence[float], Sequence[float]]  # tool, spindle and carriage, machine counts


class Gauge:
    """A roundness gauge: each time the part sits slightly off the axis, and each point has its noise.

    Deviations are um, positive outwards, at 3600 angles from the spindle index, in the direction in which the
    cut turned. Without a known start mark the trace begins at a random angle; a known one is set by hand, so
    that it is found again with a standard deviation. The error of its spindle stays at the angles of the trace,
    however the part sits; an indicator on the clamped part has none of it.
    """

    def __init__(self, true: TrueParameters, what: str = "gauge") -> None:
        self._eccentricity_um = true.gauge_eccentricity_um
        self._noise_um = true.gauge_noise_um
        self._mark_known = true.gauge_mark_known
        self._mark_sd_deg = true.gauge_mark_sd_deg
        self._lathe = str(true.lathe)
        self._chance = true.chance(what)
        self._generator = np.random.default_rng(self._chance.randrange(2**32))
        error_deg = np.arange(ANGLES) * (360.0 / ANGLES) - true.gauge_error_deg
        self._error_um: Floats = true.gauge_error_um * np.cos(true.gauge_error_upr * np.radians(error_deg))
        self._off_um: Floats = np.zeros(ANGLES)
        self._turned = 0

    def pass_over(self, parts: int) -> None:
        """Draw what so many parts take, each measured once, released."""
        for _ in range(parts):
            self.trace(np.zeros(ANGLES), 0.0, FREE)

    def trace(self, deviation_um: Floats, nominal_radius_mm: float, state: str, turned_deg: float = 0.0) -> Trace:
        """Return the trace of a section that deviates by `deviation_um` from its nominal radius, shape (3600,).

        The part is turned on the gauge by `turned_deg`, so that its start mark is there.
        """
        angle_deg: Floats = np.arange(ANGLES, dtype=np.float64) * (360.0 / ANGLES)
        self._off_um, self._turned = np.zeros(ANGLES), 0
        if self._eccentricity_um:
            towards = self._chance.uniform(0.0, 2.0 * math.pi)
            self._off_um = self._eccentricity_um * np.cos(np.radians(angle_deg) - towards)
        read_um = deviation_um + self._off_um
        if self._noise_um:
            read_um = read_um + self._generator.normal(0.0, self._noise_um, ANGLES)
        if not self._mark_known:
            self._turned = self._chance.randrange(ANGLES)
        elif self._mark_sd_deg and state == FREE:
            self._turned = round(self._chance.gauss(0.0, self._mark_sd_deg) * ANGLES / 360.0)
        self._turned += round(turned_deg * ANGLES / 360.0)
        read_um = np.roll(read_um, self._turned)
        if state == FREE:
            read_um = read_um + self._error_um
        meta = {
            "state": state,
            "simulated": "yes",
            "radius_mm": f"{nominal_radius_mm:g}",
            "direction": "spindle",
            "start_mark": "spindle index" if self._mark_known else "unknown",
            LATHE: self._lathe,
        }
        return Trace(angle_deg=angle_deg, deviation_um=read_um, meta=meta)

    def section(self, deviation_um: Floats, z_mm: float, noise: np.random.Generator) -> PartSection:
        """Return another section of the part as it was placed for its last trace, levelled to its axis."""
        read_um = deviation_um + self._off_um + noise.normal(0.0, self._noise_um, ANGLES)
        angle_deg: Floats = np.arange(ANGLES, dtype=np.float64) * (360.0 / ANGLES)
        turned_um = np.roll(read_um, self._turned) + self._error_um
        return PartSection(z_mm=z_mm, angle_deg=angle_deg, deviation_um=turned_um)


@dataclass(frozen=True, slots=True, kw_only=True)
class FromJaw:
    """Places that count from jaw 1, which is at this angle of the spindle."""

    places: int
    jaw_1_deg: float


class PartIndicator:
    """The indicator on the part, read finger-tight and at full force at the same places.

    The stylus is set to the mark by eye, once for a lathe. The part is turned by hand, once round each way, so
    that the play of the dial pulls both ways.
    """

    def __init__(self, true: TrueParameters) -> None:
        self._chance = true.chance("part indicator")
        self._noise_um, self._play_um = true.indicator_noise_um, 0.5 * true.indicator_backlash_um
        self._graduation_um = true.indicator_graduation_um
        self._off_deg = self._chance.gauss(0.0, true.gauge_mark_sd_deg)
        if true.parts_before:
            self._chance = true.chance_of_part("part indicator")
        self._finger_fraction = true.finger_force_fraction

    def readings(
        self, finger: Surface, full: Surface, jaws: int, force_n: float, from_jaw_1: FromJaw | None = None
    ) -> ClampReadings:
        """Return the readings of both states, each once round and back.

        With `from_jaw_1` they are at that number of places, which count from jaw 1, and once round alone.
        """
        places = max(LEAST_PLACES, PLACES_A_LOBE * jaws) if from_jaw_1 is None else from_jaw_1.places
        jaw_1_deg = 0.0 if from_jaw_1 is None else from_jaw_1.jaw_1_deg
        once = [360.0 * place / places for place in range(places)]
        angles = once if from_jaw_1 is not None else [*once, *reversed(once)]
        at = [angle + jaw_1_deg for angle in angles]
        said_n = FORCE_DIGITS * round(self._finger_fraction * force_n / FORCE_DIGITS)
        return ClampReadings(
            angle_deg=tuple(angles),
            finger_um=self._read(finger, at),
            full_um=self._read(full, at),
            from_jaw_1=from_jaw_1 is not None,
            graduation_um=self._graduation_um or None,
            finger_force_n=said_n or None,
            simulated=True,
        )

    def band(self, surface: Surface, jaws: int) -> BandReadings:
        """Return the readings of one state, once round and back."""
        places = max(LEAST_PLACES, PLACES_A_LOBE * jaws)
        once = [360.0 * place / places for place in range(places)]
        angles = (*once, *reversed(once))
        return BandReadings(
            angle_deg=angles, shown_um=self._read(surface, angles), graduation_um=self._graduation_um or None
        )

    def _read(self, surface: Surface, angles: Sequence[float]) -> tuple[float, ...]:
        """Return what the dial shows at the angles, in turn; it begins in the middle of its play."""
        shown, found = surface(angles[0] + self._off_deg), []
        for angle in angles:
            pushed = surface(angle + self._off_deg)
            shown = min(max(shown, pushed - self._play_um), pushed + self._play_um)
            read = shown + (self._chance.gauss(0.0, self._noise_um) if self._noise_um else 0.0)
            step = self._graduation_um
            found.append(step * round(read / step) if step else read)
        return tuple(found)


class TipPath:
    """Machine counts of tool, spindle and carriage to radius and Z of the tip, and turns since the index.

    The tip lags the scale by half of the play between them against the motion; seen in the cut alone: dials and
    collisions are as without. Exact where it matters, a bound elsewhere: far from everything neither the radial
    error of the spindle nor that of the scale has to be computed for each servo cycle.
    """

    def __init__(self, machine: MachineProfile, true: TrueParameters, wander: RadialError | None) -> None:
        self._true = true
        self.drifted_mm = 0.0  # how much further in the machine has brought the tip since it was cold
        self._wander = wander
        self._cycle_ms = machine.controller.servo_period_ms
        self._turns_per_count = 1.0 / (machine.spindle.counts_per_rev * true.belt_ratio)
        self._mm_per_carriage_count = 1.0 / machine.carriage.counts_per_mm
        self._mm_per_tool_count = 1.0 / machine.tool.counts_per_mm
        most_wander_mm = wander.most_mm if wander is not None else 0.0
        self._play = 0.5 * true.backlash_um / 1000.0 * machine.tool.counts_per_mm
        self._dragged: float | None = None  # the reading of the scale at which the tip would be without play
        off_mm = (abs(true.scale_error_um) + 0.5 * true.backlash_um) / 1000.0
        self._most_off_mm = most_wander_mm + off_mm + ROUNDING_MM

    @property
    def _home_mm(self) -> float:
        return self._true.home_radius_mm - self.drifted_mm

    def track(self, block: Block, end_ms: float) -> Track:
        """Return the path in a block of servo cycles."""
        tool, spindle, carriage = block
        per_turn, per_z, wander = self._turns_per_count, self._mm_per_carriage_count, self._wander
        turns = [y * per_turn for y in spindle]
        radius_mm = self.tips_mm(tool)
        if wander is not None:
            radius_mm = [tip - wander.at_mm(turn) for tip, turn in zip(radius_mm, turns, strict=True)]
        z_mm = [z * per_z for z in carriage]
        return Track(radius_mm=radius_mm, turns=turns, z_mm=z_mm, end_ms=end_ms, cycle_ms=self._cycle_ms)

    def tips_mm(self, counts: Sequence[float]) -> list[float]:
        """Return the radius of the tool tip at a reading of the tool's scale."""
        true, per_mm, home_mm = self._true, self._mm_per_tool_count, self._home_mm
        if not true.scale_error_um:
            return [home_mm - x * per_mm for x in counts]
        return [home_mm - x * per_mm - true.scale_wrong_mm(x * per_mm) for x in counts]

    def least_radius_mm(self, tool: Sequence[float]) -> float:
        """Return a radius that is not above that of the tip anywhere in a block."""
        return self._home_mm - max(tool) * self._mm_per_tool_count - self._most_off_mm

    def most_z_mm(self, carriage: Sequence[float]) -> float:
        """Return the largest Z in a block."""
        return max(carriage) * self._mm_per_carriage_count

    def samples(self, blocks: Sequence[Block], outside_mm: float) -> tuple[Floats, Floats, Floats]:
        """Return radius, turns and Z of many blocks; inexact only where all that is far outside `outside_mm`.

        Its ends are exact, for what joins on to them.
        """
        # All the numbers at once: an array for each of the short tracks would cost more than the cut itself.
        tool, spindle, carriage = (
            np.fromiter(chain.from_iterable([block[axis] for block in blocks]), np.float64) for axis in range(3)
        )
        turns = spindle * self._turns_per_count
        if self._play:
            tool = self._drag(tool)
        if self._true.scale_error_um:
            radius_mm = np.array(self.tips_mm(tool.tolist()))
        else:
            radius_mm = self._home_mm - tool * self._mm_per_tool_count
        if self._wander is not None:
            far = float(radius_mm.min()) - self._wander.most_mm - FAR_MM > outside_mm and len(tool) > 2 * OVERLAP
            exact = (slice(OVERLAP), slice(-OVERLAP, None)) if far else (slice(None),)
            for part in exact:
                # Python's own sine, as `track` has it: another may differ in the last bit.
                radius_mm[part] -= [self._wander.at_mm(turn) for turn in turns[part].tolist()]
        return radius_mm, turns, carriage * self._mm_per_carriage_count

    def _drag(self, counts: Floats) -> Floats:
        """Return the counts of the tip, which the scale drags along from either side of its play.

        It remembers where the tip is: the blocks of a cut come once, in their order.
        """
        at = float(counts[0]) if self._dragged is None else self._dragged
        dragged = []
        for count in counts.tolist():
            at = min(max(at, count - self._play), count + self._play)
            dragged.append(at)
        self._dragged = at
        return np.array(dragged)


class SimulatedWorkshop:
    """The chuck with its part. Machine positions are counts from flags and index."""

    def __init__(self, machine: MachineProfile, true: TrueParameters, drives: Drives) -> None:
        self._machine = machine
        self._true = true
        self._inverter = drives.inverter
        self._tool, self._carriage = drives.tool, drives.carriage
        self._load, self._wander = drives.load, drives.wander
        self._path = TipPath(machine, true, drives.wander)
        self._pending: list[Block] = []  # of the path, not yet cut
        self._count = 0
        self._seen: tuple[object, ...] = ()
        self._times_seen = 0
        self._passed: Block | None = None
        self._gauge, self._indicator = Gauge(true), PartIndicator(true)
        self._turns_per_count = 1.0 / (machine.spindle.counts_per_rev * true.belt_ratio)
        self._clampings, self._blanks = true.chance("clampings"), true.chance("blanks")
        self._fingers = true.chance("fingers")
        self._pressed: tuple[Job, float, float] | None = None  # the job, both forces of its clamping over its own
        self.parts = true.parts_before  # clamped since the machine was cold
        self._pass_over(true.parts_before)
        self.watch = CollisionWatch(true.jaw_face_mm, true.jaw_outer_radius_mm)
        self._part: Workpiece | None = None
        self._released: Workpiece | None = None
        self._nominal_radius_mm = 0.0
        self._job: Job | None = None
        self._past_middle_mm: tuple[float, ...] = ()
        self._free_end_mm = true.jaw_face_mm
        self._torque_n_m = 0.0

    def _pass_over(self, parts: int) -> None:
        """Draw what so many parts take, so that the next one is what it would be after these."""
        true = self._true
        for _ in range(parts):
            true.force_factor(self._clampings)
            true.finger_factor(self._fingers)
            true.form(self._blanks)
        self._gauge.pass_over(parts)

    def mount(self, job: Job) -> None:
        """Clamp a new blank for `job`; one whose lobe nobody knows yet springs back as the model has it."""
        true, self._released, self._job = self._true, None, job
        if job.lobe_error_source == NO_LOBE:
            with suppress(ProfileError):  # of a material without data nothing is known: it does not spring back
                job = with_modelled_lobe(job, self._machine)
        self._pending, self._count, self._seen = [], 0, ()
        self._free_end_mm = true.jaw_face_mm - job.overhang_mm
        middle_mm = self._free_end_mm + 0.5 * job.cut_length_mm
        factor = true.force_factor(self._clampings)
        self._pressed = job, true.finger_factor(self._fingers), factor
        self._path.drifted_mm = true.drifted_mm(self.parts)
        self.parts += 1
        blank = replace(true.blank(job, factor, part=self.parts), form=true.form(self._blanks))
        self._past_middle_mm = tuple(fraction * job.cut_length_mm for fraction in SECTIONS)
        sections_mm = [middle_mm + past_mm for past_mm in self._past_middle_mm]
        stock = self._stock(blank, job)
        process = true.process(job, blank, stock.passive_n_per_mm(job.feed_mm_per_rev))
        self._part = Workpiece(blank, sections_mm, true.wiper_land_mm, process)
        self._nominal_radius_mm = job.finished_radius_mm
        self._torque_n_m = cutting_torque_n_m(job)
        there = replace(clamp_job_blank(job, true.jaw_face_mm), radius_mm=blank.most_radius_mm)
        self.watch.clamp(there, self._surface_mm)
        if self._load is not None:
            self._load.clamp(replace(stock, yields_mm_per_n=process.compliances(CELLS)))

    def _stock(self, blank: Blank, job: Job) -> Stock:
        true = self._true
        return Stock(
            surface_mm=tuple((blank.radius_mm + blank.surface_mm((np.arange(CELLS) + 0.5) / CELLS)).tolist()),
            ends_mm=(self._free_end_mm, true.jaw_face_mm),
            material=material_of(job),
            fraction=true.passive_fraction,
            edge_n_per_mm=true.edge_n_per_mm,
            drifted_mm=self._path.drifted_mm,
        )

    def measure(self, past_middle_mm: float = 0.0, turned_deg: float = 0.0) -> Trace:
        """Release the part and measure its trace, turned on the gauge; repeatable until another is clamped.

        The trace is taken this far past the middle of the cut, towards the jaws, up to 0.45 lengths of the cut to
        either side; the surface is kept in a score of sections, and is a straight line between two.

        Raises:
            ValueError: the surface is not kept at `past_middle_mm`.
            RuntimeError: no part is mounted.
        """
        part = self._part or self._released
        if part is None:
            raise RuntimeError("no part is mounted")
        between = self._between(past_middle_mm)
        self._settle()
        if self._part is not None:
            self._part, self._released, self._seen = None, self._part, ()
            self.watch.release()
            if self._load is not None:
                self._load.clamp(None)
        # What another placement draws must not change what the next part measures.
        gauge = Gauge(self._true, f"gauge, part {self.parts} turned") if turned_deg else self._gauge
        trace = gauge.trace(self._free_um(part, between), self._nominal_radius_mm, FREE, turned_deg)
        if self._job is None:
            return trace
        z_mm = self._job.overhang_mm - 0.5 * self._job.cut_length_mm - past_middle_mm
        return replace(trace, meta={**trace.meta, "z_mm": f"{z_mm:g}", "z_from": "jaw faces"})

    def sections(self) -> tuple[PartSection, ...]:
        """Return five sections of the part that `measure` has placed on the gauge, from the jaws' side on.

        Raises RuntimeError: no part is there.
        """
        part, job = self._released, self._job
        if part is None or job is None:
            raise RuntimeError("no part is on the gauge")
        noise = np.random.default_rng(self._true.chance(f"sections of part {self.parts}").randrange(2**32))
        middle_mm = job.overhang_mm - 0.5 * job.cut_length_mm
        found = []
        for past_mm in (fraction * job.cut_length_mm for fraction in MEASURED):
            free_um = self._free_um(part, self._between(past_mm))
            found.append(self._gauge.section(free_um, middle_mm - past_mm, noise))
        return tuple(found)

    def _free_um(self, part: Workpiece, between: tuple[tuple[int, float], ...]) -> Floats:
        free_um: Floats = np.zeros(ANGLES)
        for section, fraction in between:
            free_um += fraction * part.released_um(section, self._nominal_radius_mm)[1]
        return free_um

    def _between(self, past_middle_mm: float) -> tuple[tuple[int, float], ...]:
        """Return the sections beside a place, with the fraction of each; one alone where it stands."""
        places = self._past_middle_mm
        order = sorted(range(len(places)), key=places.__getitem__)
        for section, following in pairwise((*order, order[-1])):
            before_mm, behind_mm = past_middle_mm - places[section], places[following] - past_middle_mm
            if abs(before_mm) <= SAME_PLACE_MM:
                return ((section, 1.0),)
            if before_mm > 0.0 and behind_mm > SAME_PLACE_MM:
                whole_mm = before_mm + behind_mm
                return (section, behind_mm / whole_mm), (following, before_mm / whole_mm)
        limit = f"from {places[order[0]]:g} to {places[order[-1]]:g} mm"
        raise ValueError(f"past_middle_mm = {past_middle_mm:g}: the surface is kept {limit}")

    def measure_clamped(self) -> Trace:
        """Measure the part in the chuck with an indicator at the tool: the error of the spindle is included."""
        if self._part is None:
            raise RuntimeError("no part is mounted")
        self._settle()
        clamped_um = self._part.clamped_um(MID_LENGTH, self._nominal_radius_mm)
        if self._wander is not None:
            clamped_um += 1000.0 * np.array([self._wander.at_mm(place / ANGLES) for place in range(ANGLES)])
        return self._gauge.trace(clamped_um, self._nominal_radius_mm, "clamped")

    def indicate(self, places: int | None = None) -> ClampReadings:
        """Return what an indicator in the middle of the cut shows of this clamping, in both of its states.

        The `places` count from jaw 1; None is as many as the lobe needs, from the spindle index.
        Raises RuntimeError: no part is mounted.
        """
        if self._part is None or self._pressed is None:
            raise RuntimeError("no part is mounted")
        job, *factors = self._pressed
        finger, full = (
            partial(self._clamped_um, self._true.press_blank(job, each, self.parts)) for each in factors
        )
        from_jaw_1 = None if places is None else FromJaw(places=places, jaw_1_deg=self._part.blank.jaw_1_deg)
        return self._indicator.readings(finger, full, job.jaws, job.chucking_force_n, from_jaw_1)

    def indicate_band(self, behind_face_mm: float) -> BandReadings:
        """Return what an indicator so far behind the face of the part shows of it as it is cut and clamped.

        Raises RuntimeError: no part is mounted.
        """
        part, job = self._part, self._job
        if part is None or job is None:
            raise RuntimeError("no part is mounted")
        self._settle()
        surface_um, wander = np.zeros(ANGLES), self._wander
        for section, fraction in self._between(behind_face_mm - 0.5 * job.cut_length_mm):
            surface_um += fraction * part.clamped_um(section, self._nominal_radius_mm)

        def shown_um(angle_deg: float) -> float:
            wander_um = 0.0 if wander is None else 1000.0 * wander.at_mm(angle_deg / 360.0)
            at_um = np.interp(angle_deg, np.arange(ANGLES) * (360.0 / ANGLES), surface_um, period=360.0)
            return float(at_um) + wander_um

        return self._indicator.band(shown_um, job.jaws)

    def _clamped_um(self, pressed: Blank, angle_deg: float) -> float:
        """Return how far out a blank is that was turned round, then pressed; with the spindle's error."""
        assert self._part is not None
        turns = angle_deg / 360.0
        wander_mm = 0.0 if self._wander is None else self._wander.at_mm(turns)
        own_mm = float(self._part.blank.form.at_mm(turns))
        in_um = float(pressed.spring_back_um(np.array([angle_deg]), pressed.middle_mm)[0])
        return 1000.0 * (own_mm + wander_mm) - in_um

    def truth(self) -> Truth:
        """Return what is so, whatever was found."""
        last, true = self._part or self._released, self._true
        jaw_1_deg = last.blank.jaw_1_deg if last else true.jaw_1_deg or 0.0
        left_um: Floats = np.zeros(ANGLES)
        if self._wander is not None:  # it brings the work nearer to the tool
            left_um += 1000.0 * np.array([self._wander.at_mm(place / ANGLES) for place in range(ANGLES)])
        if last is not None and self._job is not None:
            left_um = last.followed_um(self._job, left_um)
        # A gauge of its own, without error: a debrief must not change what the next part measures.
        trace = Gauge(replace(true, gauge_error_um=0.0)).trace(left_um, 0.0, FREE)
        return Truth(
            jaw_1_deg=jaw_1_deg % 360.0,
            zero_radius_mm=self._path.tips_mm((0.0,))[0],
            reachable_um=evaluate(trace.angle_deg, trace.deviation_um).ront_um,
            nearest_jaws_mm=self.watch.nearest_jaws_mm,
            contact_mm_per_s=self.watch.contact_mm_per_s,
        )

    def look(self, tool: float, spindle: float, carriage: float) -> WorkshopView:
        """Return the view of the chuck with the axes where they are.

        A chuck mounted as each job says has its jaw 1 at the index until a part was clamped.
        """
        part, last, true = self._part, self._part or self._released, self._true
        turns, z_mm = spindle * self._turns_per_count, carriage / self._machine.carriage.counts_per_mm
        jaw_1_deg = last.blank.jaw_1_deg if last else true.jaw_1_deg or 0.0
        # Round to a hundredth first, so that -180.001 is seen as 180 and not as -180.
        past_deg = round(360.0 * turns - jaw_1_deg, 2) % 360.0
        gap_mm = None
        if part is not None and self._free_end_mm <= z_mm <= true.jaw_face_mm:
            gap_mm = round(self._path.tips_mm((tool,))[0] - self._surface_mm(turns, z_mm), 3)
        return WorkshopView(
            jaw_1_past_mark_deg=round(past_deg - 360.0 if past_deg > 180.0 else past_deg, 2),
            tool_gap_mm=gap_mm,
            collisions=tuple(collision.kind.value for collision in self.watch.found),
        )

    def at_the_chuck(self, tool: float, spindle: float, carriage: float) -> AtTheChuck:
        """Return what dials are read from, with the axes where they are."""
        view, part, diameter_mm = self.look(tool, spindle, carriage), self._part or self._released, None
        if self._part is not None and view.tool_gap_mm is not None:
            z_mm = carriage / self._machine.carriage.counts_per_mm
            diameter_mm = 2.0 * self._part.mean_radius_mm(z_mm)
        jaws = part.blank.jaws if part is not None else JAWS
        turns = spindle * self._turns_per_count
        return AtTheChuck(
            view=view, jaws=jaws, diameter_mm=diameter_mm, tip_mm=self._path.tips_mm((tool,))[0], turns=turns
        )

    def pass_along(self, tracks: Mapping[int, Sequence[float]], end_ms: float) -> None:
        """Move the tool along the tracks of the motors: detect collisions, then cut.

        The same block of the same lists a third time changes nothing any more: the collisions in it are found,
        it is cut, and the two before it are what the next one joins on to.
        """
        machine = self._machine
        tool, spindle = tracks[machine.tool.motor], tracks[machine.spindle.motor]
        carriage = tracks[machine.carriage.motor]
        at_end = self._tool.hit_end or self._carriage.hit_end
        self._tool.hit_end = self._carriage.hit_end = False
        seen = self._seen
        if seen and tool is seen[0] and spindle is seen[1] and carriage is seen[2] and at_end is seen[3]:
            self._times_seen += 1
            if self._times_seen > LEAST_TIMES:
                return
        else:
            self._seen, self._times_seen = (tool, spindle, carriage, at_end), 1
        block = tool, spindle, carriage
        if not at_end and self.watch.misses(self._path.least_radius_mm(tool), self._path.most_z_mm(carriage)):
            self._passed, near = block, None
        else:
            near = self._look(block, end_ms, at_end)
        if self._part is not None:
            if self._inverter is not None:
                self._load_spindle(near or self._path.track(block, end_ms))
            self._pending.append(block)
            self._count += len(tool)
            if self._count >= CHUNK:
                self._settle()

    def _look(self, block: Block, end_ms: float, at_end: bool) -> Track:
        """Look for collisions in a block, after those that cannot have had any."""
        if self._passed is not None:
            tool, spindle, carriage = self._passed
            self.watch.pass_by(self._path.track((tool[-1:], spindle[-1:], carriage[-1:]), end_ms))
            self._passed = None
        track = self._path.track(block, end_ms)
        self.watch.look(track, at_end=at_end)
        return track

    def _load_spindle(self, track: Track) -> None:
        assert self._inverter is not None and self._part is not None
        in_part = self._free_end_mm <= track.z_mm[-1] <= self._true.jaw_face_mm
        cutting = in_part and track.radius_mm[-1] < self._part.blank.most_radius_mm
        self._inverter.load_n_m = self._torque_n_m if cutting else 0.0

    def _settle(self) -> None:
        """Cut along the pending path."""
        if self._part is not None and self._pending:
            self._part.cut(*self._path.samples(self._pending, self._part.blank.most_radius_mm))
        self._pending, self._count = [], 0

    def _surface_mm(self, turns: float, z_mm: float) -> float:
        """Return how far out the clamped surface is, see `Workpiece.clamped_radius_mm`."""
        assert self._part is not None
        self._settle()
        return self._part.clamped_radius_mm(turns, z_mm)
