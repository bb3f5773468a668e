"""The PLC that holds a machine to its host: when the host's counter stops, a flag is set and a jog is stopped."""

from __future__ import annotations

from drivers.pmac.dialect import TURBO
from drivers.pmac.plcs.plc import timer_variables
from tests.drivers.plc_bench import PlcBench

LEASE_CYCLES = 677
"""300 ms at the 442 us of the factory's I10."""

BACKGROUND_CYCLES = 11
BEAT_EVERY = 10
"""Background cycles between two beats of the host: about 50 ms."""

HEARTBEAT = f"""I5111={LEASE_CYCLES}
WHILE(I5111>0)
IF(P100!=P101)
P101=P100
I5111={LEASE_CYCLES}
ENDIF
ENDWHILE
IF(P102=0)
P102=1
CMD"#1J/"
ENDIF"""


class Card:
    """Background cycles of a card: the timers of its servo cycles, then a scan of the PLC."""

    def __init__(self, text: str) -> None:
        self.bench = PlcBench(text, TURBO)
        self.servo_cycles = 0

    def background(self) -> None:
        store = self.bench.store
        running = timer_variables(store.dialect, store.i(68))
        for index in running:
            self.bench.set(f"I{index}", store.i(index) - BACKGROUND_CYCLES)
        self.servo_cycles += BACKGROUND_CYCLES
        assert self.bench.scan() is None

    def beat(self) -> None:
        self.bench.set("P100", self.bench.value("P100") + 1)


def test_nothing_happens_as_long_as_the_host_counts() -> None:
    card = Card(HEARTBEAT)
    for cycle in range(1000):
        if cycle % BEAT_EVERY == 0:
            card.beat()
        card.background()
    assert card.bench.value("P102") == 0
    assert card.bench.said() == []


def test_when_the_host_stops_the_flag_and_one_stop_come_within_the_lease() -> None:
    card = Card(HEARTBEAT)
    for _ in range(20):
        card.beat()
        card.background()
    last_beat = card.servo_cycles
    while card.bench.value("P102") == 0:
        card.background()
        assert card.servo_cycles - last_beat <= LEASE_CYCLES + 2 * BACKGROUND_CYCLES
    assert card.servo_cycles - last_beat >= LEASE_CYCLES
    assert card.bench.said() == [("command", "#1J/", "", 1, 1)]
    for _ in range(200):
        card.background()
    assert card.bench.said() == []  # latched: one edge, one command


def test_a_flag_that_is_taken_back_arms_the_watch_again() -> None:
    card = Card(HEARTBEAT)
    for _ in range(100):
        card.background()
    assert len(card.bench.said()) == 1
    card.bench.set("P102", 0)
    for _ in range(100):
        card.background()
    assert len(card.bench.said()) == 1
