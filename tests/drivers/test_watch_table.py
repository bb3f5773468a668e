"""What is read beside the polls of a cut: which values, in which order, how long a whole turn of them takes."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

from benchmarks.hostile_host import plan_of
from drivers.commissioning.checked_configuration import stated_settings_of
from drivers.cutting.strategy import Strategy
from drivers.cutting.watch_table import CutWatch, CutWatchTable, WatchItem, begin_watch, watch_table
from drivers.lathe.lathe import Lathe
from drivers.lathe.motion import CUT_POLL_S
from drivers.lathe.polling import READING_S
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.program_constants import find_assigned_variables
from drivers.pmac.program_load import LoadedProgram, load_program
from drivers.pmac.program_text import read_program
from drivers.simulator.machine import SimulatedLathe
from tests.system.lathe_sites import compact

ROOT = Path(__file__).parents[2]
EVERY = [(family, strategy) for family in ("pmac", "turbo") for strategy in Strategy]
BITS_A_BYTE = 10  # start, eight, stop


class Loaded:
    """A program of a strategy in a controller, and what is watched of it."""

    def __init__(self, family: str, strategy: Strategy) -> None:
        self.machine = compact(family)
        sim = SimulatedLathe(self.machine)
        link = MemoryLink(sim.connect(), sim)
        self.client = PmacClient(link, sim)
        self.lathe = Lathe(self.client, self.machine, sim, StopPath(link))
        self.lathe.connect()
        self.program: LoadedProgram = load_program(
            self.client, plan_of(family, strategy).program, DIALECTS[family]
        )
        self.table: CutWatchTable = watch_table(self.machine, self.program)
        self.watch: CutWatch = begin_watch(self.client, self.table)

    @property
    def names(self) -> set[str]:
        return {name for item in self.table.items for name in item.names}


@cache
def loaded(family: str, strategy: Strategy) -> Loaded:
    return Loaded(family, strategy)


@pytest.mark.first(5)
@pytest.mark.parametrize(("family", "strategy"), EVERY)
def test_the_table_has_what_is_compared_at_arming_and_set_by_programs(family: str, strategy: Strategy) -> None:
    of = loaded(family, strategy)
    own = find_assigned_variables(of.program.program)
    compared = {f"I{index}" for index in stated_settings_of(of.machine, of.program.dialect)}
    assert compared - {"I5"} <= of.names, "whether PLCs run is left to the heartbeat"
    assert not {name for name in of.names & own if not name.startswith("I")}
    kept = {each.name for each in of.program.constants if each.kept}
    assert kept <= of.names
    assert {"#1->", "#2->", "#3->", "I10", "I103", "I108", "I168"} <= of.names
    entries = {"I8000", "I8001", "I8002"} if family == "turbo" else {"Y:$720", "Y:$721", "Y:$722"}
    assert entries <= of.names, "the encoder conversion of each motor"
    assert ("I193" if family == "pmac" else "I5193") in of.names


def test_a_setting_of_the_program_is_as_it_was_or_as_the_program_has_it() -> None:
    """The slew of the time base is 1644 before a cut on the spindle's time, and 8388607 in it."""
    of = loaded("turbo", Strategy.TIMEBASE)
    (item,) = (each for each in of.table.items if "I5194" in each.names)
    noted = dict(zip(item.names, of.watch._answers[item], strict=True))
    for value, told in (("1644", False), ("8388607", False), ("822", True)):
        found = of.watch.see([item], list({**noted, "I5194": value}.values()))
        assert (found is not None and found.key == "I5194") is told, value


def test_what_shapes_the_path_of_the_tool_most_comes_before_its_limits() -> None:
    of = loaded("pmac", Strategy.PVT)
    first = {name for item in of.table.first for name in item.names}
    encoder_and_scale, loop, friction = range(102, 110), (129, *range(130, 140)), (163, 167, 168, 169)
    clocks = (10, 192, 193, 194, 195)
    shaping = {f"I{number}" for number in (*encoder_and_scale, *loop, *friction, *clocks)}
    assert {name for name in first if name.startswith("I")} == shaping
    assert {"Y:$813", "Y:$720"} <= first and "P12" not in first
    places = [place for place, item in enumerate(of.table.schedule) if "I130" in item.names]
    limits = [place for place, item in enumerate(of.table.schedule) if "I111" in item.names]
    assert len(places) >= 3 * len(limits)
    assert "I8000" in {name for item in loaded("turbo", Strategy.PVT).table.first for name in item.names}


@pytest.mark.parametrize("strategy", [Strategy.PVT, Strategy.CAM])
def test_a_correction_is_watched_unless_a_table_moves_it(strategy: Strategy) -> None:
    """A table of the program moves that of the tool, one that was on before the cut may move any."""
    of, words = loaded("pmac", strategy), ["Y:$46", "Y:$82", "Y:$BE"]
    assert [word in of.names for word in words] == [strategy is Strategy.PVT, True, True]
    table = watch_table(of.machine, of.program, tables_on=True)
    assert not {name for item in table.items for name in item.names} & set(words)


def test_the_whole_table_comes_round() -> None:
    of = loaded("turbo", Strategy.CAM)
    watch, seen = CutWatch(of.table, of.watch._answers), set[WatchItem]()
    for _ in of.table.schedule:
        seen.update(watch.next_items(1.0))
    assert seen == set(of.table.items)
    again = [watch.next_items(1.0) for _ in of.table.schedule]
    assert {item for items in again for item in items} == seen, "and on to the end of the feed"


def test_a_difference_from_the_beginning_is_told_and_a_setting_that_deviated_then_is_not() -> None:
    table = CutWatchTable(
        first=(WatchItem("I130..131", ("I130", "I131")),), later=(WatchItem("#1-> &1", ("#1->",)),)
    )
    watch = CutWatch(table, {table.first[0]: ("400", "4905"), table.later[0]: ("X",)})
    assert watch.see(table.items, ("400", "4905.000000001", "X")) is None
    problem = watch.see(table.items, ("400", "4906", "X"))
    assert problem is not None
    assert (problem.code, problem.key, problem.value, problem.limit) == (
        "cut.constant_differs",
        "I131",
        "4906",
        "4905",
    )
    axis = watch.see(table.items, ("400", "4905", "1.01X"))
    assert axis is not None
    assert axis.key == "#1->"


def test_the_last_turn_begins_anew_after_a_feed_hold() -> None:
    of = loaded("pmac", Strategy.PVT)
    watch = CutWatch(of.table, of.watch._answers)
    began = []
    for over in (True, False, True):
        watch.see_feed(over=over)
        began.append(watch.at_end)
        if began == [True]:
            watch.next_items(1.0)
    assert began == [True, False, True]
    read = [item for _ in of.table.items for item in watch.next_items(1.0)]
    assert tuple(read) == of.table.items
    assert not watch.at_end


@pytest.mark.parametrize(
    ("lengths", "values", "fit"),
    [
        ((49, 49, 49, 49, 1), 1, 4),  # with a blank each 200 characters
        ((49, 49, 49, 50, 1), 1, 3),
        ((5, 5, 5, 5, 5), 8, 4),  # 32 values
        ((5, 5, 5, 5, 5), 9, 3),
        ((5, 5, 5, 5, 5), 11, 2),
        ((300, 5), 1, 1),  # one at least
    ],
)
def test_a_line_of_queries_has_200_characters_at_most(lengths: tuple[int, ...], values: int, fit: int) -> None:
    """A controller takes 255 characters; polls and renewals of the watchdog have to come in between."""
    items = tuple(WatchItem("I" * length, (f"{place}",) * values) for place, length in enumerate(lengths))
    watch = CutWatch(CutWatchTable(first=(), later=items), dict.fromkeys(items, ()))
    watch.see_feed(over=True)
    assert watch.next_items(1e9) == items[:fit]


def test_the_last_turn_begins_where_the_tool_is_commanded_out_of_the_part() -> None:
    """The program goes on, to bring its axes to rest: meanwhile all of it is read once more."""
    sim = SimulatedLathe(compact("pmac"))
    link = MemoryLink(sim.connect(), sim)
    lathe = Lathe(PmacClient(link, sim), compact("pmac"), sim, StopPath(link))
    lathe.connect()
    lathe.enable()
    lathe.home()
    cut = "OPEN PROG 3\nCLEAR\nABS LINEAR TA100 TS0 TM300\nX500\nDWELL300\nX0\nDWELL300\nCLOSE"
    lathe.program.load(read_program(cut))
    lathe.program.note_settings()
    watch, polls, told = lathe.program._watch, list[Snapshot](), list[bool]()
    assert watch is not None
    see_feed = watch.see_feed

    def record(*, over: bool) -> None:
        told.append(over)
        see_feed(over=over)

    watch.see_feed = record  # type: ignore[method-assign]
    lathe.program.start(3, 0.0)
    lathe.program.follow(polls.append, 60.0, clear_counts=250.0)
    running = [
        (poll.tool.commanded_position, over)
        for poll, over in zip(polls, told, strict=True)
        if poll.program_running
    ]
    assert {over for _, over in running} == {True, False}
    assert all(over is (commanded < 250.0) for commanded, over in running)


def whole_turn_s(of: Loaded, baud: float | None) -> tuple[float, float]:
    """Return how long it takes until everything, and until what comes first, was read on a line of this speed.

    Counted from bytes: a poll as it is sent and answered, its pause, and as much beside it as the poller takes.
    """
    of.lathe.snapshot()
    poll_bytes, line = of.lathe._poller._poll_bytes, of.lathe.poll_line
    byte_s = BITS_A_BYTE / baud if baud else 0.0
    watch, unread, first = CutWatch(of.table, of.watch._answers), set(of.table.items), set(of.table.first)
    at_s = first_s = 0.0
    while unread:
        round_trip_s = poll_bytes * byte_s
        items = watch.next_items(poll_bytes * READING_S / max(round_trip_s, 1e-6), len(line))
        reading_s = sum(map(watch.bytes_of, items)) * byte_s
        at_s += round_trip_s + max(CUT_POLL_S, reading_s)
        unread -= set(items)
        first_s = first_s or (0.0 if unread & first else at_s)
    return at_s, first_s


LINES = {"network": None, "115200": 115200.0, "38400": 38400.0, "9600": 9600.0}


def test_the_document_says_how_long_a_turn_takes_on_each_line() -> None:
    text = (ROOT / "docs" / "planned-cut.md").read_text(encoding="utf-8")
    for name, baud in LINES.items():
        row = re.search(rf"^\| {name}[^|]*\|([^|]+)\|([^|]+)\|$", text, re.MULTILINE)
        assert row is not None, name
        first_s, whole_s = (float(cell.strip().removesuffix(" s")) for cell in row.groups())
        of_families = [whole_turn_s(loaded(family, Strategy.PVT), baud) for family in ("pmac", "turbo")]
        assert max(each[1] for each in of_families) == pytest.approx(first_s, rel=0.1), (name, of_families)
        assert max(each[0] for each in of_families) == pytest.approx(whole_s, rel=0.1), (name, of_families)
