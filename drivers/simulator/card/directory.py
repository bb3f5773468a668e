"""What memory shows of the stored programs: which there are, where they begin, and which PLCs are off.

A program begins one word after each line of those before it; the real controller needs some words a line.
"""

from __future__ import annotations

from drivers.pmac.families.family import BufferDirectory
from drivers.simulator.card.controller import Controller

_PLC_OFF = 1 << 22


class StoredBuffers:
    """The directory of one controller, as far as its family is known to have one."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._places = controller.dialect.buffer_directory

    def word(self, space: str, address: int) -> int | None:
        """Return a word of the directory; None outside it."""
        places = self._places
        if places is None:
            return None
        if address in places.programs:
            return self._program(space, address - places.programs.start, places)
        if address in places.plcs:
            return self._plc(space, address - places.plcs.start, places)
        return None

    def _program(self, space: str, entry: int, places: BufferDirectory) -> int:
        """X the number, Y where it begins; in the order in which they were opened."""
        programs = list(self._controller.programs.items())
        if entry >= len(programs):
            return 0
        if space == "X":
            return programs[entry][0]
        return places.storage + sum(len(lines) for _, lines in programs[:entry])

    def _plc(self, space: str, number: int, places: BufferDirectory) -> int:
        plcs = self._controller.plcs
        begins = places.storage + sum(map(len, self._controller.programs.values()))
        begins += sum(len(lines) for n, lines in plcs.buffers.items() if n < number)
        stored = number in plcs.buffers
        off = 0 if stored and number in plcs.switches.enabled else _PLC_OFF
        return (begins if stored else 0) | (off if space == "Y" else 0)
