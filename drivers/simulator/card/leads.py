"""Coupling of a motor, or of a coordinate system's time, to other motors within the servo cycle.

Compensation tables, position following and external time base. As long as none of them is in use, the controller
runs whole blocks motor by motor; as soon as one is, it runs one servo cycle after another, the motors in the order
of their numbers: a table whose source has a higher number than its target sees it one cycle late. Time bases and
followers use the counts of the master in the servo cycle that has just ended.

In the encoder conversion table the encoder at channel n is that of motor n. Entries that are neither an encoder
nor a time base convert nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from drivers.pmac.compensation.table import CompensationTable, TableSource
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.master.time_base import (
    METHOD_SHIFT,
    TIME_BASE_METHOD,
    Following,
    FollowingMode,
    FollowingSetup,
    TimeBaseEntry,
    TriggeredTimeBase,
    entry_of,
    in_counts,
    increment_units,
    parts_of,
)
from drivers.pmac.memory import WORD_BITS
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.motor import Motor
from drivers.simulator.card.table_memory import TableMemory

TABLES_ON = 51  # I51: whether compensation tables are in use
_FOLLOWING = (5, 6, 7, 8)
_ENABLE = 6
_TIME_BASE_SOURCE = 93
_WORD = (1 << WORD_BITS) - 1
_METHOD = _WORD >> WORD_BITS - METHOD_SHIFT  # what is below the method digit of a set-up word
_ENCODER_METHOD = 0x0
_TWO_LINES = (TIME_BASE_METHOD, 0x9, 0xA, 0xB)  # methods of the entries that have two lines


@dataclass(slots=True, kw_only=True)
class _Follower:
    motor: Motor
    master: Motor
    setup: FollowingSetup
    state: Following

    def step(self) -> None:
        parts = parts_of(self.master.counter) & _WORD
        if parts == self.state.master_parts:
            return
        self.state, increment = self.state.step(self.setup, parts)
        self.motor.follow_master(in_counts(increment, self.setup))


@dataclass(slots=True, kw_only=True)
class _Clock:
    """A time base entry that drives coordinate systems; `parts` and `true_position` are of the previous cycle."""

    entry: TimeBaseEntry
    master: Motor
    systems: tuple[CoordinateSystem, ...] = ()
    parts: int
    true_position: float
    triggered: TriggeredTimeBase | None

    def step(self) -> int:
        """Return the time of this servo cycle, 2^-23 ms, and pass it to the systems."""
        master = self.master
        if self.triggered is None:
            parts = parts_of(master.counter)
            units = increment_units(self.entry.factor, parts - self.parts)
            self.parts = parts
        else:
            caught = master.passed_index(self.true_position, master.true_position)
            captured = None if caught is None else round(caught + master.counter - master.true_position)
            self.triggered, units = self.triggered.step(round(master.counter), captured)
            self.true_position = master.true_position
        for system in self.systems:
            system.time_base.lead(units)
            system.busy = True
        return units


class Conversion:
    """Set-up words by line; in a family that has I-variables for them, those are the words.

    `revision` counts the changes of words that are not I-variables. `results` are the time bases of the cycle that
    has just ended, 2^-23 ms, by the line of their result.
    """

    def __init__(self, variables: VariableStore, motors: Mapping[int, Motor]) -> None:
        self.revision = 0
        self.results: dict[int, int] = {}
        self._table = variables.dialect.conversion_table
        self._variables = variables
        self._motors = motors
        self._words: dict[int, int] = {}
        self.reset()

    @property
    def changed_words(self) -> dict[int, int]:
        """The words by line that differ from the factory's, in a family that has no settings for them."""
        factory = dict(enumerate(self._table.setup))
        return {line: word for line, word in sorted(self._words.items()) if word != factory.get(line, 0)}

    def reset(self, changed: Mapping[int, int] | None = None) -> None:
        """Restore the factory words, except those in `changed`, by line."""
        if self._table.first_setting is None:
            self._words = {**dict(enumerate(self._table.setup)), **(changed or {})}
        self.results.clear()
        self.revision += 1

    def line_at(self, address: int) -> int | None:
        """Return the line at an address, 0 the first."""
        line = address - self._table.first_address
        return line if 0 <= line < self._table.lines else None

    def word(self, line: int) -> int:
        """Return the unsigned set-up word of a line."""
        first = self._table.first_setting
        return self._words.get(line, 0) if first is None else int(self._variables.i(first + line)) & _WORD

    def set_word(self, line: int, word: int) -> None:
        """Change a set-up word."""
        first = self._table.first_setting
        if first is None:
            self._words[line] = word & _WORD
            self.revision += 1
        else:
            self._variables.set(VariableKind.I, first + line, float(word & _WORD))

    def result(self, line: int) -> int:
        """Return the result of a line: a position in 1/32 count, which rolls over, or a time base."""
        if line in self.results:
            return self.results[line] & _WORD
        master = self.encoder(self._table.first_address + line)
        return 0 if master is None else parts_of(master.counter) & _WORD

    def encoder(self, address: int) -> Motor | None:
        """Return the motor whose encoder the line at an address converts."""
        line = self.line_at(address)
        if line is None or self.word(line) >> METHOD_SHIFT != _ENCODER_METHOD:
            return None
        # The second line of an entry holds the scale factor of the first one.
        second = line > 0 and self.word(line - 1) >> METHOD_SHIFT in _TWO_LINES
        return None if second else self.channel(self.word(line))

    def channel(self, address: int) -> Motor | None:
        """Return the motor whose encoder has its registers at an address."""
        channels = self._table.channels
        return self._motors.get(channels.index(address) + 1) if address in channels else None

    def time_base(self, address: int) -> TimeBaseEntry | None:
        """Return the entry whose time base is at an address: its second line."""
        line = self.line_at(address)
        return None if not line else entry_of(line - 1, self.word(line - 1), self.word(line))


class Leads:
    """Tracks the settings, and applies the active couplings in each servo cycle."""

    def __init__(
        self,
        variables: VariableStore,
        motors: Mapping[int, Motor],
        systems: Mapping[int, CoordinateSystem],
        conversion: Conversion,
        tables: TableMemory,
    ) -> None:
        self.active = False
        self._variables = variables
        self._motors = motors
        self._systems = systems
        self._conversion = conversion
        self._tables = tables
        self._seen = (-1, -1, -1)
        self._clocks: dict[int, _Clock] = {}
        self._followers: dict[int, _Follower] = {}
        self._corrected: dict[int, list[CompensationTable]] = {}
        self._places: dict[int, int] | None = {}
        self._order: tuple[Sequence[Motor], tuple[Motor, ...]] = ((), ())
        self._sources: frozenset[int] = frozenset()

    @property
    def in_order(self) -> bool:
        """Whether tables are all that is active, and motors can be run in an order in which sources come first."""
        return self._places is not None

    def order_motors(self, motors: Sequence[Motor]) -> tuple[Motor, ...]:
        """Return motors in that order."""
        if motors is not self._order[0]:
            places = self._places or {}
            ordered = sorted(motors, key=lambda motor: places.get(motor.number, motor.number))
            self._order = motors, tuple(ordered)
        return self._order[1]

    def refresh(self) -> bool:
        """Read the settings if they may have changed; return whether any coupling is active."""
        settings, conversion, tables = self._seen
        if (
            self._variables.i_revision != settings
            or self._conversion.revision != conversion
            or self._tables.revision != tables
        ):
            self._seen = self._variables.i_revision, self._conversion.revision, self._tables.revision
            self._find_clocks()
            self._find_followers()
            self._corrected = {}
            for table in self._tables.tables.values() if self._variables.i(TABLES_ON) else ():
                self._corrected.setdefault(table.definition.target, []).append(table)
            self.active = bool(self._clocks or self._followers or self._corrected)
            self._find_order()
        return self.active

    def begin_cycle(self) -> None:
        """Read the counts of the masters in the servo cycle that has just ended."""
        for line, clock in self._clocks.items():
            before = clock.triggered.state if clock.triggered else None
            self._conversion.results[line] = clock.step()
            if clock.triggered and clock.triggered.state is not before:
                # The set-up word shows a host that time has begun.
                method = self._conversion.word(line - 1) & _METHOD
                self._conversion.set_word(line - 1, method | clock.triggered.state << METHOD_SHIFT)
        for follower in self._followers.values():
            follower.step()
        for number in self._corrected:
            motor = self._motors[number]
            if not motor.activated:
                self.correct(motor)  # it is not stepped now, and must not jump when it is stepped again

    def correct(self, motor: Motor) -> None:
        """Compute the correction of a motor from the present positions of its sources."""
        tables = self._corrected.get(motor.number)
        if tables:
            motor.correction = sum(
                table.correction(*map(self._place, table.definition.sources)) for table in tables
            )

    def sources(self) -> dict[int, tuple[float, float]]:
        """Return encoder and commanded position of each source of a table, as they are now."""
        return {number: (self._motors[number].encoder, self._motors[number].desired) for number in self._sources}

    def let_stand(self, sources: Mapping[int, tuple[float, float]], cycles: int) -> None:
        """Let the sources keep their positions in a stretch, until one is run through it."""
        for number, (encoder, desired) in sources.items():
            self._motors[number].replay.stand(encoder, desired, cycles)

    def corrections(
        self, motor: Motor, cycles: int, before: Mapping[int, tuple[float, float]]
    ) -> list[float] | None:
        """Return the corrections of a motor in a stretch in which its sources have been run already.

        None without a table. `before` are the `sources` before that stretch.
        """
        tables = self._corrected.get(motor.number)
        if not tables:
            return None
        found = [0.0] * cycles
        for table in tables:
            tracks = [self._visible_places(source, motor, before) for source in table.definition.sources]
            corrections = table.corrections(tracks)
            for at in range(cycles):
                found[at] += corrections[at]
        return found

    def _visible_places(
        self, source: TableSource, target: Motor, before: Mapping[int, tuple[float, float]]
    ) -> list[float]:
        """Return the places of a source that the target sees: a cycle late if its own number is lower."""
        replay = self._motors[source.motor].replay
        passed = replay.commands if source.desired else replay.encoders
        if source.motor < target.number:
            return passed
        return [before[source.motor][source.desired], *passed[:-1]]

    def _find_order(self) -> None:
        """Find an order of the motors in which sources come before their targets."""
        self._places, self._sources, self._order = None, frozenset(), ((), ())
        if self._clocks or self._followers or any(not self._motors[each].activated for each in self._corrected):
            return
        needs = {
            target: {source.motor for table in tables for source in table.definition.sources}
            for target, tables in self._corrected.items()
        }
        order: list[int] = []
        waiting = list(self._motors)
        while waiting:
            ready = [number for number in waiting if needs.get(number, set()) <= set(order)]
            if not ready:
                return  # some correct each other, or one itself
            order += ready
            waiting = [number for number in waiting if number not in ready]
        self._places = {number: place for place, number in enumerate(order)}
        self._sources = frozenset().union(*needs.values())

    def _place(self, source: TableSource) -> float:
        motor = self._motors[source.motor]
        return motor.desired if source.desired else motor.encoder

    def _find_clocks(self) -> None:
        """Find the time base entries that are in use; one that was in use continues from its state."""
        before, self._clocks = self._clocks, {}
        self._conversion.results.clear()
        for system in self._systems.values():
            address = int(self._variables.system(system.number, _TIME_BASE_SOURCE))
            line, entry = self._conversion.line_at(address), self._conversion.time_base(address)
            master = self._master(entry)
            if line is None or entry is None or master is None:
                # Without a master no time passes; an address outside the table is the register of `%`.
                if system.time_base.led:
                    system.busy = True
                    system.motion.forget_debt()
                system.time_base.lead(None if line is None else 0)
                continue
            clock = self._clocks.get(line) or _clock(entry, master, before.get(line))
            if line not in before or system not in before[line].systems:
                system.motion.forget_debt()
            clock.systems = (*clock.systems, system)
            self._clocks[line] = clock

    def _master(self, entry: TimeBaseEntry | None) -> Motor | None:
        if entry is None:
            return None
        find = self._conversion.encoder if entry.trigger is None else self._conversion.channel
        return find(entry.source)

    def _find_followers(self) -> None:
        before, self._followers = self._followers, {}
        dialect = self._variables.dialect
        offset, bit = dialect.offset_following
        for number, motor in self._motors.items():
            if not int(motor.variable(_ENABLE)) & 1:
                # As nearly all motors, nearly always: any setting that is written may lead here.
                motor.offset_following = bool(int(motor.variable(offset)) >> bit & 1)
                continue
            settings = {dialect.motor_index(number, each): motor.variable(each) for each in _FOLLOWING}
            setup = FollowingSetup.of_motor(number, settings, dialect)
            motor.offset_following = setup.offset
            master = self._conversion.encoder(setup.master) if setup.mode is not FollowingMode.OFF else None
            if master is None:
                continue
            follower = before.get(number)
            parts = parts_of(master.counter) & _WORD
            same = follower is not None and follower.master is master
            state = follower.state if follower is not None and same else Following(master_parts=parts)
            self._followers[number] = _Follower(motor=motor, master=master, setup=setup, state=state)


def _clock(entry: TimeBaseEntry, master: Motor, before: _Clock | None) -> _Clock:
    """Return the clock of an entry. Master motion before its use is not made up for."""
    same = before is not None and before.master is master and (before.triggered is None) == (entry.trigger is None)
    parts, true_position, counts = parts_of(master.counter), master.true_position, round(master.counter)
    if before is not None and same:
        parts, true_position = before.parts, before.true_position
        counts = before.triggered.counts if before.triggered else counts
    triggered = None
    if entry.trigger is not None:
        triggered = TriggeredTimeBase(state=entry.trigger, factor=entry.factor, counts=counts)
    return _Clock(entry=entry, master=master, parts=parts, true_position=true_position, triggered=triggered)
