"""What is simulated in blocks, and the velocity that is reported."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.pmac.dialect import DIALECTS, PMAC, TURBO
from drivers.pmac.execution import moves
from drivers.pmac.gathering.gather import gather_settings
from drivers.pmac.gathering.gather_client import motor_channel
from drivers.pmac.heartbeat.plc import Policy, set_up_lines
from drivers.pmac.language import blocks
from drivers.pmac.reported_velocity import AveragedVelocity
from drivers.pmac.trajectory.pieces import Piece
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.player import Player
from drivers.simulator.card.registers import CardMemory
from drivers.simulator.card.servo import ServoAxis
from drivers.simulator.card.stretch import Stretch
from drivers.simulator.commands import line
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant import workshop
from drivers.simulator.plant.axis import Ends, NoisyScale, Scale
from drivers.simulator.plant.collision import CollisionWatch
from drivers.simulator.plant.driven_mass import DrivenMass
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.servo_gains import ServoGains
from drivers.simulator.plant.spindle import RadialError, SimulatedSpindle
from drivers.simulator.plant.true_parameters import ideal
from drivers.simulator.plant.workpiece import OVERLAP
from profiles.machine import MachineProfile
from profiles.store import load_job
from tests.compact import compact_machine
from tests.drivers.wire_card import Wire, wire

CYCLE_S = 0.000442
GAINS = ServoGains(ix08=96, ix09=96, ix30=528, ix31=4905, ix32=4905, ix33=811, ix34=1, ix35=20000, ix69=10_531)
LINES = (
    "#1? P F #2? P V #3? P F &1?? ??? % P300 I113",
    "&1B1R", "&1H", "&1R", "&1Q", "&1%70", "&1%100", "&1A", "#1J/", "#2J/", "#3J/", "#1J+", "#2J+", "#3J-",
    "#1J:700", "#3J:-2000", "#2J:3000", "#1K", "#2K", "#3K", "#1HM", "#3HM", "#2HMZ", "#1O2", "#2O-3", "#3O1",
    "\x01", "\x0b", "I51=1", "I51=0", "I130=400", "I130=528", "ENDGATHER", "#1J/#2J/#3J/&1B1R", "#2J+#3J-",
)  # fmt: skip
GATHERED = ("actual", "following_error", "commanded", "velocity")
PROGRAM = (
    "OPEN PROG1 CLEAR", "TA20 TS5 F5 INC", "P300=0", "WHILE(P300<9)", "X0.4 Z-0.4", "DWELL7", "X-0.4 Z0.4",
    "P300=P300+1", "M70==P300*2", "PVT20", "X0.1:2 Z0:0", "X0.1:0 Z0:0", "LINEAR", "ENDWHILE", "CLOSE",
)  # fmt: skip
TABLES = ("#1DEFINE COMP 4,#2,#1,4000", "#1DEFINE COMP 4,#3D,#1,4000", "#3DEFINE COMP 4,#2,#3,3000")


class SlowAxis(ServoAxis):
    """A servo cycle at a time."""

    def follow(self, commands: Sequence[float]) -> list[float]:
        return _by_cycle(self, lambda: self._follow_by_cycle(commands))

    def _drift(self, held: float, cycles: int) -> list[float]:
        return _by_cycle(self, lambda: self._drift_by_cycle(held, cycles))


def _by_cycle(axis: ServoAxis, run: Callable[[], list[float]]) -> list[float]:
    axis.at_end = False
    return run()


def built(kind: type[ServoAxis], random: Random) -> ServoAxis:
    mass = DrivenMass(
        damping_per_s=random.choice((0.0, 40.0)),
        acceleration_per_bit=20_000.0,
        peak_output_bits=9000.0,
        friction=random.choice((0.0, 3e6)),
    )
    ends = random.choice((None, Ends(lowest=-300.0, highest=400.0)))
    scale = NoisyScale(1.5, 3) if random.random() < 0.4 else Scale()
    lag_s = random.choice((0.0, 0.0002))
    return kind(mass, GAINS, CYCLE_S, random.uniform(-50.0, 50.0), ends, scale, lag_s)


@dataclass(frozen=True, kw_only=True)
class Act:
    """What happens to an axis: `what` for so many cycles, under the faults."""

    what: int
    commands: list[float]
    rest: list[float]
    jammed: bool
    lost: bool

    def __call__(self, axis: ServoAxis) -> tuple[Any, ...]:
        """Return all that can be seen of it, and all that it will go on from."""
        axis.jammed, axis.encoder_lost = self.jammed, self.lost
        done = self._done(axis)
        state = axis._x, axis._v, axis._integral, axis._reading, axis.output_bits, axis.at_end, axis._blind
        return done, state, axis.scale.now, axis.scale.before

    def _done(self, axis: ServoAxis) -> object:
        cycles = len(self.commands)
        match self.what:
            case 0:
                return axis.follow(self.commands)
            case 1:
                return axis.push(0.3, cycles)
            case 2:
                return axis.coast(cycles)
            case 3:
                return axis.close_loop()
            case 4:
                axis.rebase(17.25)
                return None
            case 5:
                axis.set_gains(replace(GAINS, ix30=400))
                return None
        # The same list again is how an axis is told that nothing is commanded to move.
        return [axis.follow(self.rest) for _ in range(3)]


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_an_axis_in_blocks_moves_as_an_axis_in_cycles(seed: int) -> None:
    fast, slow = (built(kind, Random(seed)) for kind in (ServoAxis, SlowAxis))
    random = Random(seed)
    rest = [0.0] * 11
    for _ in range(40):
        place, step = random.uniform(-500.0, 500.0), random.choice((0.0, 0.5, 30.0))
        if random.random() < 0.3:
            rest = [random.choice((0.0, float(round(place)), place))] * 11
        act = Act(
            what=random.randrange(9),
            commands=[place + step * cycle for cycle in range(random.choice((1, 2, 11)))],
            rest=rest,
            jammed=random.random() < 0.05,
            lost=random.random() < 0.05,
        )
        assert act(fast) == act(slow), act


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_a_piece_of_motion_is_its_cubic_at_each_servo_instant(seed: int) -> None:
    random = Random(seed)
    cubics = tuple(tuple(random.choice((0.0, random.uniform(-9.0, 9.0))) for _ in range(4)) for _ in range(2))
    piece = Piece(100.0, cubics)  # type: ignore[arg-type]
    player, singly, one = (Player((0.0, 0.0)) for _ in range(3))
    for each in (player, singly, one):
        each.append([piece])
    start = [each.sample(3, 0.44) for each in (player, singly, one)]
    assert start[0] == start[1] == start[2]
    since = player._elapsed_ms
    track = player.sample(7, 0.44)
    for places, (c0, c1, c2, c3) in zip(track, cubics, strict=True):
        times = [since + 0.44 * k for k in range(1, 8)]
        assert places == [((c3 * t + c2) * t + c1) * t + c0 for t in times]
    cycles = [one.sample(1, 0.44) for _ in range(7)]
    assert singly.sample_singly(7, 0.44) == [[cycle[motor][0] for cycle in cycles] for motor in range(2)]
    assert (singly.position, singly._elapsed_ms) == (one.position, one._elapsed_ms)


@pytest.fixture
def slowly(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], None]]:
    """Takes away everything that is there for speed only."""

    def take_away() -> None:
        patch = monkeypatch.setattr
        patch(ServoAxis, "follow", SlowAxis.follow)
        patch(ServoAxis, "_drift", SlowAxis._drift)
        patch(Stretch, "length", lambda *_: 1)
        patch(line, "_parse_stateless_line", line._parse_stateless_line.__wrapped__)
        patch(CollisionWatch, "misses", lambda *_: False)
        patch(SimulatedSpindle, "_creeps", lambda *_: False)
        patch(CardMemory, "bits_of", lambda *_: None)
        patch(CardMemory, "passing", lambda *_: None)
        patch(blocks, "WORTH", math.inf)
        patch(moves, "WORTH", math.inf)
        patch(workshop, "LEAST_TIMES", math.inf)
        patch(workshop, "FAR_MM", math.inf)

    yield take_away


def told(seed: int) -> list[Any]:
    """All that can be seen of a lathe to which random things happen at random times."""
    random = Random(seed)
    machine, dialect = compact_machine().machine, DIALECTS[("pmac", "turbo")[seed % 2]]
    plant = ("ideal", "steady")[seed // 2 % 2]
    sim = SimulatedLathe(machine, plant_named(plant, machine, 7, mounted_by_hand=seed % 5 > 0), dialect)
    host, seen = sim.connect(), list[Any]()
    run_block = sim.controller.run_block

    def kept(cycles: int) -> dict[int, list[float]]:
        tracks = run_block(cycles)
        seen.append(tracks)
        return tracks

    sim.controller.run_block = kept  # type: ignore[method-assign]
    sources = [motor_channel(each, 1, dialect.factory, dialect).source for each in GATHERED]
    gathering = [f"I{index}={value}" for index, value in gather_settings(sources, 1, dialect).items()]
    lines = ["I3=2 I6=1", *PROGRAM, *gathering, "#1J/#2J/#3J/"]
    lines += [random.choice(TABLES), "200", "-100", "30", "0", f"I51={seed % 2}"]
    lines += set_up_lines(machine, dialect, Policy.STOP) if seed % 3 == 0 else ()
    lines += ["I123=-60 #1HM#3HM#2J+"] if seed % 4 == 1 else ()
    sim.mount(replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.5))
    for text in lines:
        host.receive(text.encode() + b"\r")
        sim.wait(0.006)
    for _ in range(25):
        sim.wait(random.choice((0.003, 0.02, 0.15)))
        text = random.choice((*LINES, *[f"ENDGATHER DELETE GATHER DEFINE GATHER {90 + seed} GATHER"] * 8))
        host.receive(text.encode() + (b"\r" if text >= " " else b""))
        if random.random() < 0.1:
            name, motor = random.choice(
                (("encoder-loss", "tool"), ("index-lost", "spindle"), ("limit", "carriage"))
            )
            sim.faults.inject(name, for_s=0.1, motor=motor)
        motors = [sim.controller.motors[number] for number in (1, 2, 3)]
        seen.append([(m.desired, m.actual, m.velocity, m.correction, m.position, m.in_position) for m in motors])
        seen.append(host.take_output())
    host.receive(b"LIST GATHER\r")
    sim.wait(0.1)
    return [*seen, host.take_output(), sim.collisions, sim.measure().deviation_um.tolist()]


def cut_under_load() -> list[Any]:
    """A realistic lathe whose tool is led by its spindle, in material, with its registers gathered."""
    machine, seen = compact_machine().machine, list[Any]()
    sim = SimulatedLathe(machine, plant_named("steady", machine, 7, mounted_by_hand=True))
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.5)
    sim.mount(job)
    host, (tool, _, carriage) = sim.connect(), (sim.controller.motors[number] for number in (1, 2, 3))
    in_mm = machine.tool.home_radius_mm - job.radius_mm + 0.1
    in_counts = in_mm * machine.tool.counts_per_mm - tool.true_position
    load = sim._drives.load
    assert load is not None
    to_mm = machine.carriage.jaw_face_mm - job.overhang_mm
    to_counts = to_mm * machine.carriage.counts_per_mm - carriage.true_position
    sources = [motor_channel(each, 1, PMAC.factory, PMAC).source for each in ("actual", "following_error")]
    gathering = " ".join(f"I{index}={value}" for index, value in gather_settings(sources, 2, PMAC).items())
    for text, seconds in (
        ("I3=2 I6=1 I322=2000 I319=100 #1J/#2J/#3J/", 0.1),
        (TABLES[0], 0.0),
        ("200 -100 30 0", 0.1),
        (f"I51=1 #2J+ #3J:{to_counts:.0f}", 0.7),
        (f"#1J:{in_counts:.0f}", 0.6),
        ("I322=20 #3J+", 0.2),
        (f"{gathering} DEFINE GATHER 301", 0.1),
        ("GATHER", 0.4),
    ):
        host.receive(text.encode() + b"\r")
        for _ in range(max(1, round(seconds / 0.02))):
            sim.wait(0.02)
            seen.append((load.force_n, tool.actual, tool.desired, tool.correction, carriage.actual))
    host.receive(b"LIST GATHER\r")
    sim.wait(0.1)
    assert max(force_n for force_n, *_ in seen) > 5.0, "nothing was cut"
    return [*seen, host.take_output(), sim.measure().deviation_um.tolist()]


def test_a_cut_under_load_is_the_same_at_any_speed(slowly: Callable[[], None]) -> None:
    fast = cut_under_load()
    slowly()
    assert fast == cut_under_load()


def test_far_outside_only_the_ends_of_a_path_are_exact() -> None:
    machine = compact_machine().machine
    true = plant_named("steady", machine, 7)
    path = workshop.TipPath(machine, true, RadialError(1.2, Random(1)))
    blocks = [([37.0 * k + n for n in range(11)], [40.0 * n for n in range(11)], [0.0] * 11) for k in range(4)]
    exact = [radius for block in blocks for radius in path.track(block, 0.0).radius_mm]
    near, far = (path.samples(blocks, outside_mm)[0].tolist() for outside_mm in (1000.0, 0.0))
    assert near == exact
    assert (far[:OVERLAP], far[-OVERLAP:]) == (exact[:OVERLAP], exact[-OVERLAP:])


def test_the_tip_lags_its_scale_by_half_the_play_and_rests_at_each_reversal() -> None:
    """A sine of 20 um with a play of 6 um: once in, the tip is 3 um behind, and swings by 17 um."""
    machine = compact_machine().machine
    path = workshop.TipPath(machine, replace(ideal(machine), backlash_um=6.0), None)
    turn = 2.0 * np.pi * np.arange(1200) / 400
    scale_mm = 5.0 + 0.020 * np.sin(turn)
    counts = (scale_mm * machine.tool.counts_per_mm).tolist()
    blocks = [(counts[at : at + 50], [0.0] * 50, [0.0] * 50) for at in range(0, 1200, 50)]
    radius_mm = np.concatenate([path.samples([block], 1000.0)[0] for block in blocks])
    behind_um = 1000.0 * (radius_mm - (machine.tool.home_radius_mm - scale_mm))[400:]
    moves_in = np.cos(turn[400:]) > 0.0
    assert np.abs(behind_um).max() == pytest.approx(3.0, abs=1e-6)
    assert behind_um[moves_in].max() == pytest.approx(3.0) and behind_um[~moves_in].min() == pytest.approx(-3.0)
    assert 500.0 * np.ptp(radius_mm[400:]) == pytest.approx(17.0, abs=1e-6)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.first(2)
def test_a_lathe_does_the_same_at_any_speed(seed: int, slowly: Callable[[], None]) -> None:
    fast = told(seed)
    slowly()
    slow = told(seed)
    for at, (one, other) in enumerate(zip(fast, slow, strict=True)):
        assert one == other, at


# V: of the last servo cycle on a PMAC, averaged over I60 and I61 on a Turbo.

JOG = "I400=1 I10=3713707 I419=0 I420=10 I421=0 I422=49.5 #4J+"
"""49.5 counts/ms, which the manual says are 21.9 counts in a servo cycle (Software Reference, V)."""


def turbo(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


def cycles_ms(card: Wire, cycles: int) -> float:
    return cycles * card.card.servo_period_ms


def velocity(card: Wire) -> float:
    return float(card.ask("#4V")[0])


def test_a_turbo_says_the_average_of_256_servo_cycles_and_a_pmac_that_of_one(machine: MachineProfile) -> None:
    """The spread of single cycles, 21 and 22 counts, is not seen."""
    card = turbo(machine)
    card.tell(JOG)
    card.sim.wait(1.0)
    told = set()
    for _ in range(100):
        card.sim.wait(0.005)
        told.add(velocity(card))
    assert told == {21.9}
    assert {float(v) for v in card.raw("\x16").split()[3:4]} == {21.9}
    card = wire(machine, PMAC)
    card.tell(JOG)
    card.sim.wait(1.0)
    told = set()
    for _ in range(100):
        card.sim.wait(0.005)
        told.add(velocity(card))
    assert told == {21.0, 22.0}


def test_the_average_lags_by_its_length_and_ends_with_it(machine: MachineProfile) -> None:
    """From rest at full speed it rises as the part of the 256 cycles in which the motor has moved."""
    card = turbo(machine)
    card.tell(JOG)
    card.sim.wait(cycles_ms(card, 128) / 1000.0)
    assert 0.3 * 21.9 < velocity(card) < 0.6 * 21.9
    card.sim.wait(cycles_ms(card, 300) / 1000.0)
    assert velocity(card) == 21.9
    card.tell("#4K")
    card.sim.wait(2.0)
    assert velocity(card) == 0.0


@pytest.mark.parametrize(("period", "shift", "shown"), [(0, 4, 21.9), (3, 6, 21.9), (15, 9, 10.9), (7, 8, 10.9)])
def test_period_and_shift(machine: MachineProfile, period: int, shift: int, shown: float) -> None:
    """The change over 16 (I60 + 1) cycles, divided by 2 to the I61."""
    card = turbo(machine)
    card.tell(f"I60={period} I61={shift}", JOG)
    card.sim.wait(1.0)
    assert velocity(card) == pytest.approx(shown, abs=0.11)


def test_a_new_zero_is_no_velocity(machine: MachineProfile) -> None:
    card = turbo(machine)
    card.tell("I400=1 #4J=5000")
    card.settle()
    card.sim.wait(0.3)
    assert velocity(card) == 0.0
    card.tell("#4HMZ")
    assert velocity(card) == 0.0
    card.sim.wait(0.3)
    assert velocity(card) == 0.0


def test_blocks_of_any_length_keep_the_same_positions() -> None:
    variables = VariableStore({60: 3, 61: 6}, TURBO)
    one, many = AveragedVelocity(variables, (60, 61)), AveragedVelocity(variables, (60, 61))
    places = [float(n * n) for n in range(500)]
    done = 0
    for size in (1, 2, 3, 5, 7, 11, 200, 13, 258):
        for at in many.kept_cycles(size, done):
            many.keep(places[done + at])
        done += size
    assert done == len(places)
    for n, place in enumerate(places):
        if one.kept_cycles(1, n):
            one.keep(place)
    assert many.counts_per_cycle == one.counts_per_cycle == (499.0**2 - 435.0**2) / 64
