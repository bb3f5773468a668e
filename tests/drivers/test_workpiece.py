"""The part: what a tool cuts off it, with which force, and what an indicator shows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.tip_load import ALUMINIUM, CELLS, Stock, TipGeometry, TipLoad
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from drivers.simulator.plant.workpiece import Blank, LobeAlong, Workpiece
from profiles.cutting import cutting_force
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.materials import material_named
from profiles.roundness import evaluate
from profiles.store import load_job, load_machine

CYCLE_S = 3_713_707 / 8_388_608_000
RADIUS, FINISHED = 26.0, 25.9


def part(
    lobe: float = 0.0, jaws: int = 3, jaw_1: float = 0.0, sections: tuple[float, ...] = (100.0,)
) -> Workpiece:
    return Workpiece(Blank(radius_mm=RADIUS, lobe_um_pp=lobe, jaws=jaws, jaw_1_deg=jaw_1), sections, land_mm=0.4)


def pass_over(
    workpiece: Workpiece, radius_um: np.ndarray, turns: np.ndarray, z_mm: np.ndarray, block: int = 11
) -> None:
    """Hand the samples over in blocks, as the card does; `radius_um` is outward from the finished radius."""
    radius_mm = FINISHED + radius_um / 1000
    for start in range(0, len(turns), block):
        part_of = slice(start, start + block)
        workpiece.cut(radius_mm[part_of].tolist(), turns[part_of].tolist(), z_mm[part_of].tolist())


def deviation(workpiece: Workpiece, section: int = 0) -> tuple[np.ndarray, np.ndarray]:
    return workpiece.released_um(section, FINISHED)


def turning(seconds: float, rpm: float, start_turns: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Sample times and spindle turns."""
    time_s = np.arange(round(seconds / CYCLE_S)) * CYCLE_S
    return time_s, start_turns + time_s * rpm / 60


@pytest.mark.parametrize("start_turns", [0.0, 0.123, -3.7])
def test_between_the_samples_of_a_150_hz_motion_the_surface_is_exact(start_turns: float) -> None:
    """3000 rpm, three lobes of 27.5 um, 45 samples a turn, over more than one chunk of samples."""
    workpiece = part()
    _, turns = turning(5.0, 3000, start_turns)
    radius = -27.5 * np.cos(2 * np.pi * 3 * turns)
    pass_over(workpiece, radius, turns, np.full_like(turns, 100.0))
    angle, found = deviation(workpiece)
    assert np.abs(found + 27.5 * np.cos(np.radians(3 * angle))).max() < 0.01


def test_a_land_leaves_no_place_uncut_and_blocks_of_samples_do_not_matter() -> None:
    found = []
    for block in (1, 11, 977, 5000):
        workpiece = part()
        _, turns = turning(3.0, 1000)
        pass_over(workpiece, 5 * np.sin(2 * np.pi * 3 * turns + 1), turns, np.full_like(turns, 100.0), block)
        found.append(deviation(workpiece)[1])
    for other in found[1:]:
        assert np.abs(other - found[0]).max() < 1e-3
    # 30 rpm: one turn takes more samples than are worked in at a time.
    workpiece = part()
    _, turns = turning(2.1, 30)
    pass_over(workpiece, np.zeros_like(turns), turns, np.full_like(turns, 100.0))
    assert np.abs(deviation(workpiece)[1]).max() < 1e-6


def test_each_order_has_its_own_height_along_the_part_and_an_uncut_part_is_high_at_the_jaws() -> None:
    along = LobeAlong(z_mm=np.array([98.0, 102.0]), values={3: np.array([0.9, 1.1]), 2: np.array([1.0, 1.5])})
    blank = Blank(radius_mm=RADIUS, lobe_um_pp=55, jaws=3, jaw_1_deg=20, oval_um=4.0, along=along, middle_mm=100.0)
    workpiece = Workpiece(blank, (98.0, 100.0, 102.0), land_mm=0.4)
    for section, (lobe, oval) in enumerate(((0.9, 1.0), (1.0, 1.25), (1.1, 1.5))):
        angle, found = deviation(workpiece, section)
        past = np.radians(angle - 20)
        assert np.abs(found - 100 - lobe * 27.5 * np.cos(3 * past) - oval * 4.0 * np.cos(2 * past)).max() < 1e-9
    angle, found = deviation(part(lobe=55, jaw_1=20))
    target = 100 + 27.5 * np.cos(np.radians(3 * (angle - 20)))
    assert np.abs(found - target).max() < 1e-9


@pytest.mark.parametrize(("jaws", "lobe", "jaw_1", "rpm"), [(3, 55, 0, 1000), (4, 21, 33, 640), (6, 8, -70, 2345)])
def test_a_round_cut_leaves_the_lobe_of_the_clamping(jaws: int, lobe: float, jaw_1: float, rpm: float) -> None:
    workpiece = part(lobe, jaws, jaw_1)
    _, turns = turning(1.0, rpm)
    pass_over(workpiece, np.zeros_like(turns), turns, np.full_like(turns, 100.0))
    angle, found = deviation(workpiece)
    result = evaluate(angle, found, None)
    assert result.ront_um == pytest.approx(lobe, abs=0.01)
    assert result.amplitude_um(jaws) == pytest.approx(lobe / 2, abs=0.001)
    crest = next(h.phase_deg for h in result.harmonics if h.n == jaws)
    assert np.cos(np.radians(jaws * (crest - jaw_1))) == pytest.approx(1)


def test_a_tool_moves_where_the_part_will_be_high_and_of_the_wrong_sign_doubles_the_error() -> None:
    workpiece = part(lobe=55)
    _, turns = turning(1.0, 1000)
    pass_over(workpiece, -27.5 * np.cos(2 * np.pi * 3 * turns), turns, np.full_like(turns, 100.0))
    assert np.ptp(deviation(workpiece)[1]) < 0.01
    workpiece = part(lobe=55)
    _, turns = turning(1.0, 1000)
    pass_over(workpiece, 27.5 * np.cos(2 * np.pi * 3 * turns), turns, np.full_like(turns, 100.0))
    assert np.ptp(deviation(workpiece)[1]) == pytest.approx(110, abs=0.01)


def test_a_path_at_a_constant_offset_changes_the_size_and_not_the_form() -> None:
    sizes, forms = [], []
    for offset in (0.0, -35.0):
        workpiece = part(lobe=33)
        _, turns = turning(1.0, 1000)
        pass_over(workpiece, np.full_like(turns, offset), turns, np.full_like(turns, 100.0))
        found = deviation(workpiece)[1]
        sizes.append(found.mean())
        forms.append(found - found.mean())
    assert sizes[1] - sizes[0] == pytest.approx(-35, abs=1e-6)
    assert np.abs(forms[1] - forms[0]).max() < 1e-6


def test_what_is_outside_stands_or_turns_back_is_not_cut() -> None:
    workpiece = part()
    _, turns = turning(0.5, 1000)
    pass_over(workpiece, np.full_like(turns, 150.0), turns, np.full_like(turns, 100.0))
    assert np.abs(deviation(workpiece)[1] - 100).max() < 1e-9
    workpiece = part()
    _, turns = turning(0.5, 1000)
    pass_over(workpiece, np.full_like(turns, -50.0), np.full_like(turns, 0.25), np.full_like(turns, 100.0))
    pass_over(workpiece, np.full_like(turns, -50.0), 0.25 - turns, np.full_like(turns, 100.0))
    assert np.abs(deviation(workpiece)[1] - 100).max() < 1e-9


def test_the_surface_is_the_least_radius_that_the_tool_has_been_at() -> None:
    workpiece = part()
    _, turns = turning(0.5, 1000)
    for radius in (20.0, 0.0, 50.0):
        # The tool changes its depth beside the part.
        z_mm = np.where((turns < 0.5) | (turns > turns[-1] - 0.5), 110.0, 100.0)
        pass_over(workpiece, np.full_like(turns, radius), turns, z_mm)
    assert np.abs(deviation(workpiece)[1]).max() < 1e-6


def test_only_the_land_of_the_tool_cuts_and_not_what_it_comes_back_over() -> None:
    """The tool feeds from 99 to 99.9 mm; with 0.4 mm of land it reaches sections up to 100.1 mm."""
    workpiece = part(sections=(99.5, 100.05, 100.2))
    _, turns = turning(2.0, 1000)
    pass_over(workpiece, np.zeros_like(turns), turns, np.linspace(99.0, 99.9, len(turns)))
    assert np.abs(deviation(workpiece, 0)[1]).max() < 1e-6
    assert np.abs(deviation(workpiece, 1)[1]).max() < 1e-6
    assert deviation(workpiece, 2)[1].min() == pytest.approx(100)
    workpiece = part()
    time_s, turns = turning(1.0, 1000)
    z_mm = np.where((time_s > 0.3) & (time_s < 0.7), 110.0, 100.0)
    radius = np.where((time_s > 0.4) & (time_s < 0.6), -80.0, 0.0)
    pass_over(workpiece, radius, turns, z_mm)
    assert np.abs(deviation(workpiece)[1]).max() < 1e-6


@pytest.mark.parametrize("feed", [0.4, 0.3999, 0.05])
@pytest.mark.parametrize("rpm", [1000, 2000, 2857])
def test_a_feed_of_up_to_the_land_leaves_no_place_uncut(feed: float, rpm: float) -> None:
    """The land is 0.4 mm: at that feed each place meets it in one turn only, in parts of servo intervals too."""
    workpiece = part(lobe=55)
    _, turns = turning(1.2 * 60 / rpm * (1 + 0.4 / feed), rpm, start_turns=0.377)
    middle = turns.mean()
    path = -27.5 * np.cos(2 * np.pi * 3 * turns)
    pass_over(workpiece, path, turns, 100.0 + feed * (turns - middle))
    assert np.ptp(deviation(workpiece)[1]) < 0.01


def test_only_what_is_inside_the_land_cuts_within_one_interval_too() -> None:
    """One turn takes 100 samples, fed 4 mm: the land of 0.4 mm covers a tenth of it, 36 deg."""
    workpiece = part()
    turns = np.arange(-50, 51) * 0.01 + 0.505
    pass_over(workpiece, np.zeros_like(turns), turns, 100.0 + 4.0 * (turns - 0.5))
    angle, found = deviation(workpiece)
    cut = np.abs(found) < 1e-6
    assert np.abs(found[~cut] - 100).max() < 1e-9
    assert (angle[cut].min(), angle[cut].max()) == (pytest.approx(162.0), pytest.approx(198.0))
    assert cut.sum() == 361
    workpiece = part()
    turns = np.arange(20) * 0.01
    z_mm = 99.0 + 2.0 * np.maximum(np.arange(20) - 9, 0).clip(max=1)
    pass_over(workpiece, np.zeros_like(turns), turns, z_mm)
    angle, found = deviation(workpiece)
    # Between samples 9 and 10, 32.4 to 36 deg: the land is over it from 0.4 to 0.6 of the way, 33.84 to 34.56.
    cut = angle[np.abs(found) < 1e-6]
    assert (cut.min(), cut.max()) == (pytest.approx(33.9), pytest.approx(34.5))


# The force of the cut on the tool against Kienzle's tables, and what it meets on the second pass.

RADIUS_MM, HOME_MM, COUNTS_PER_MM = 26.0, 76.0, 5000.0
TURN_COUNTS, Z_COUNTS_PER_MM, LAND_MM = 10_000.0, 1000.0, 0.4
BLOCK = 11

Depth = Callable[[float], float]
"""Depth of the tip below the blank, mm, at so many turns."""


@dataclass
class Axis:
    """An axis as the motor of it is seen."""

    true_position: float = 0.0
    pace: float = 0.0
    cycles_run: int = 0


class Cutting:
    """A blank of 30 mm under a tool that does what it is told, from its free end on."""

    def __init__(self, share: float = 1.0, edge_n_per_mm: float = 0.0, feed_mm: float = 0.05) -> None:
        geometry = TipGeometry(
            home_radius_mm=HOME_MM,
            land_mm=LAND_MM,
            tool_counts_per_mm=COUNTS_PER_MM,
            carriage_counts_per_mm=Z_COUNTS_PER_MM,
            spindle_counts_per_turn=TURN_COUNTS,
        )
        self.load = TipLoad(geometry, None, push_per_n=2.0)
        self.tool, self.spindle, self.carriage = Axis(), Axis(), Axis()
        self.load.watch(self.tool, self.spindle, self.carriage)
        self.stock = Stock(
            surface_mm=(RADIUS_MM,) * CELLS,
            ends_mm=(170.0, 200.0),
            material=ALUMINIUM,
            fraction=share,
            edge_n_per_mm=edge_n_per_mm,
        )
        self.load.clamp(self.stock)
        self.turn_step = 1000.0 / 60.0 * CYCLE_S
        self.feed_mm = feed_mm

    def clamp(self, form_mm: Depth) -> None:
        """Clamp another blank, whose surface is this much further out at a turn of the spindle."""
        surface_mm = tuple(RADIUS_MM + form_mm((cell + 0.5) / CELLS) for cell in range(CELLS))
        self.load.clamp(replace(self.stock, surface_mm=surface_mm))

    def passes(self, depth_mm: Depth, turns: float, z_mm: float = 170.0) -> tuple[np.ndarray, np.ndarray]:
        """Turn so far from a place on; return turns and forces (N) of every cycle in which the edge is inside."""
        start = math.ceil(self.spindle.true_position / TURN_COUNTS)
        at, forces = [], []
        self.spindle.pace = self.turn_step * TURN_COUNTS
        self.carriage.pace = self.turn_step * self.feed_mm * Z_COUNTS_PER_MM
        for block in range(round(turns / self.turn_step / BLOCK)):
            turned = start + block * BLOCK * self.turn_step
            self.spindle.true_position = (turned - self.turn_step) * TURN_COUNTS
            z = z_mm - 0.5 * LAND_MM + (turned - start - self.turn_step) * self.feed_mm
            self.carriage.true_position = z * Z_COUNTS_PER_MM
            self.load.begin()
            for cycle in range(BLOCK):
                now = turned + cycle * self.turn_step
                self.load.push((HOME_MM - RADIUS_MM + depth_mm(now)) * COUNTS_PER_MM)
                at.append(now)
                forces.append(self.load.force_n)
            for axis in (self.tool, self.spindle, self.carriage):
                axis.cycles_run += BLOCK
            self.spindle.true_position = (turned + (BLOCK - 1) * self.turn_step) * TURN_COUNTS
        inside = slice(BLOCK, None)
        return np.array(at)[inside], np.array(forces)[inside]


def lobed(turns: np.ndarray, forces: np.ndarray) -> tuple[float, complex]:
    """The mean, and the wave three times a turn, by least squares."""
    angle = 6.0 * np.pi * turns
    columns = np.column_stack([np.ones_like(angle), np.cos(angle), np.sin(angle)])
    mean, cosine, sine = np.linalg.lstsq(columns, forces, rcond=None)[0]
    return float(mean), complex(cosine, -sine)


@pytest.mark.parametrize(
    ("depth_mm", "feed_mm", "force_n"),
    [(0.10, 0.05, 7.40), (0.10, 0.10, 12.45), (0.06, 0.05, 4.44), (0.06, 0.10, 7.47), (0.1275, 0.10, 15.87)],
)
def test_the_force_is_the_share_of_the_tables(depth_mm: float, feed_mm: float, force_n: float) -> None:
    """Wrought aluminium, 700 N/mm2 and 0.25: 0.4 of it; a chip of 0.02 mm and more does not feel the edge."""
    _, forces = Cutting(0.4, 7.0, feed_mm).passes(lambda _: depth_mm, 4.0)
    assert forces == pytest.approx(0.4 * force_n, abs=0.005)


@pytest.mark.parametrize(("feed_mm", "edge"), [(0.02, 0.0), (0.01, 0.5), (0.005, 0.75)])
def test_the_edge_comes_in_on_a_thin_chip_as_it_is_predicted(feed_mm: float, edge: float) -> None:
    """7 N/mm on a chip of no thickness, half of it at 0.01 mm, where Kienzle has 700 x 0.1 x 0.01^0.75 N."""
    _, forces = Cutting(0.4, 7.0, feed_mm).passes(lambda _: 0.1, 4.0)
    assert forces == pytest.approx(0.4 * (700.0 * 0.1 * feed_mm**0.75 + 7.0 * 0.1 * edge), abs=0.005)
    predicted = cutting_force(material_named("Al"), 0.1, feed_mm, passive_fraction=0.4, edge_n_per_mm=7.0)
    assert forces == pytest.approx(predicted.passive_n, abs=1e-6)


def test_a_lobed_path_has_a_lobed_force() -> None:
    """124.5 N for each mm at a feed of 0.1 mm: 55 um peak to peak are 6.85 N, three times a turn."""
    turns, forces = Cutting(feed_mm=0.1).passes(lambda t: 0.1 + 0.0275 * math.sin(6 * math.pi * t), 12.0)
    mean_n, harmonic = lobed(turns, forces)
    assert abs(harmonic) == pytest.approx(3.42, abs=0.02)
    assert mean_n == pytest.approx(12.45, abs=0.02)


def test_a_second_pass_meets_what_the_first_has_left_or_next_to_nothing() -> None:
    cutting = Cutting()

    def path(turns: float) -> float:
        return 0.1 + 0.0275 * math.sin(6.0 * math.pi * turns)

    _, first = cutting.passes(path, 20.0)
    _, second = cutting.passes(path, 12.0)
    assert first.mean() == pytest.approx(7.40, abs=0.02)
    # The tip moves by up to 1.4 um from a place of the surface to the next.
    assert np.abs(second).max() < 0.12
    # A round pass 30 um deeper over a lobe of 20 um: 74 N/mm on 30 um on the average, and on 10 um of wave.
    cutting = Cutting()
    cutting.passes(lambda t: 0.1 + 0.01 * math.cos(6 * math.pi * t), 20.0)
    turns, forces = cutting.passes(lambda _: 0.13, 12.0)
    mean_n, harmonic = lobed(turns, forces)
    assert mean_n == pytest.approx(0.030 * 74.0, rel=0.02)
    assert harmonic == pytest.approx(-0.010 * 74.0, rel=0.05, abs=0.03)


@pytest.mark.parametrize(
    ("depth_mm", "z_mm", "feed_mm"), [(-0.01, 170.0, 0.05), (0.1, 160.0, 0.05), (0.1, 170.0, 0.0)]
)
def test_without_a_chip_there_is_no_force(depth_mm: float, z_mm: float, feed_mm: float) -> None:
    """Beside the surface, before the free end, and without a feed."""
    _, forces = Cutting(feed_mm=feed_mm).passes(lambda _: depth_mm, 3.0, z_mm)
    assert not forces.any()


def test_it_pushes_the_tool_out_and_nothing_when_the_part_is_gone() -> None:
    cutting = Cutting()
    cutting.passes(lambda _: 0.1, 3.0)
    cutting.load.begin()
    assert cutting.load.push((HOME_MM - RADIUS_MM + 0.1) * COUNTS_PER_MM) == pytest.approx(-2.0 * 7.40, abs=0.01)
    cutting.load.clamp(None)
    cutting.load.begin()
    assert cutting.load.push((HOME_MM - RADIUS_MM + 0.1) * COUNTS_PER_MM) == 0.0


# The indicator on the simulated part: what it shows of a clamping, by formulas of a ring, and what is its own.

MACHINE = load_machine("lee-2001-lathe").machine
JOB = load_job("lee-2001-experiment-1").job


def shown(true: TrueParameters, job: Job = JOB, clampings: int = 1) -> list[ClampReadings]:
    lathe, found = SimulatedLathe(MACHINE, true), []
    for _ in range(clampings):
        lathe.mount(job)
        found.append(lathe.indicate())
    return found


def wave(readings: ClampReadings, order: int) -> complex:
    """Return an order of the spring-back by a sum over equal angles."""
    angle = np.radians(readings.angle_deg)
    sprung = np.array(readings.finger_um) - np.array(readings.full_um)
    return complex(2.0 * np.mean(sprung * np.exp(-1j * order * angle)))


def test_an_ideal_lathe_shows_the_lobe_at_rest_of_a_ring_that_is_not_yet_cut() -> None:
    (found,) = shown(ideal(MACHINE))
    # E 55 um p-p at 1000 rpm, where 3 jaws of 0.2 kg at 35 mm lose 3 * 0.2 * 0.035 * (1000 pi / 30)^2 = 230.3 N.
    loss_n = 3 * 0.2 * 0.035 * (1000 * np.pi / 30) ** 2
    at_rest = 27.5 * 1314.0 / (1314.0 - loss_n)
    assert abs(wave(found, 3)) == pytest.approx(at_rest * (2.4 / 2.5) ** 3, rel=1e-6)
    assert abs(wave(found, 2)) < 1e-9 and abs(wave(found, 1)) < 1e-9
    assert np.degrees(np.angle(wave(found, 3))) / -3 == pytest.approx(JOB.lobe_phase_deg % 120 - 120, abs=1e-6)


def test_two_clampings_differ_by_their_force_and_the_blank_drops_out() -> None:
    true = replace(
        ideal(MACHINE), clamping_force_spread=0.05, blank_oval_um_pp=20.0, blank_run_out_um=40.0, seed=5
    )
    lobes = [abs(wave(each, 3)) for each in shown(true, clampings=40)]
    assert np.std(np.log(lobes)) == pytest.approx(0.05, rel=0.3), "at rest in proportion to all of the force"
    assert all(abs(wave(each, 2)) < 1e-9 for each in shown(true, clampings=3))
    raw = np.array(shown(true)[0].finger_um)
    assert np.ptp(raw) > 20.0, "run-out and oval of the blank are in the readings"


def test_the_realistic_dial_has_graduations_play_and_noise_and_finger_tight_is_no_zero_force() -> None:
    true = plant_named("realistic", MACHINE, 4)
    (found,) = shown(true)
    assert found.simulated and found.graduation_um == 1.0 and found.finger_force_n in (60.0, 70.0)
    assert all(value == round(value) for value in (*found.finger_um, *found.full_um))
    assert len(found.angle_deg) == 32 and found.places == 16
    once, back = np.array(found.full_um[:16]), np.array(found.full_um[16:][::-1])
    assert 0.5 < np.std(once - back) < 5.0, "the play pulls both ways"


def test_places_from_jaw_1_turn_with_the_chuck() -> None:
    true = replace(ideal(MACHINE), jaw_1_deg=200.0)
    lathe = SimulatedLathe(MACHINE, true)
    with pytest.raises(RuntimeError):
        lathe.indicate()
    lathe.mount(JOB)
    found = lathe.indicate(12)
    assert found.from_jaw_1 and found.full_um[0] == pytest.approx(min(found.full_um))
    assert np.angle(wave(found, 3)) == pytest.approx(0.0, abs=1e-9)
