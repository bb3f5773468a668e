"""One host connection of the simulated controller: its line discipline, its queue, and its share of the time.

Work is counted in values: one read or set, or one line of data, is about a microsecond.
"""

from __future__ import annotations

import re
from collections.abc import Generator

from drivers.errors import LinkError
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.commands.line import answers, commands
from drivers.simulator.commands.status import ACTING, ACTIONS, CONTROL_X, REPORTING, STOPS
from drivers.simulator.context import Context
from drivers.simulator.faults.lines import HostOutput, LineDirection, Lines
from drivers.simulator.hosts import replies
from profiles.problem import Problem

CR = 0x0D
BACKSPACE, REPEAT, SUM, RECALL = b"\x08", b"\t", b"\x0e", b"\x19"
LINES_PER_TURN = 4  # maximum lines of one host per turn: none can block the controller for the others
WORK_PER_TURN = 2560  # values after which no command of a host is begun in a turn, nor while it owes as many
LINES_PER_CYCLE = 64  # maximum lines of one host before the next background cycle, however often it has a turn
WORK_PER_CYCLE = 1024  # credit of a host per background cycle, about a quarter of its time; the rest is owed
LINE_LIMIT = 255  # maximum characters of one command line
ANSWER_PER_TURN = 4096  # reply bytes after which no further line of that host is begun in the same go

# Bytes that may wait; the transport holds back the rest. It is ample, so that a stop is heard after a flood.
INBOX_LIMIT = 1_048_576
ANNOUNCED_LIMIT = 65_536  # maximum unread bytes before program messages are lost on that host
_PART_WORK, _CHARACTERS_A_VALUE = 4, 2  # cost of a part of the queue: fixed, and per characters
_REPORT_WORK, _REPORTED_A_VALUE = 10, 3  # cost of a report: a minimum, and one for so many characters
_ANSWERED = (CR, *REPEAT, *SUM, *RECALL)
_PART = re.compile(b"[" + bytes((*_ANSWERED, *BACKSPACE)) + b"]")
"""Characters at which the queue is split, so that each of them is charged."""

_AT_ONCE = re.compile(b"[" + bytes((*ACTIONS, CONTROL_X)) + b"]")
_REPORT = re.compile(b"[" + bytes(REPORTING) + b"]")
_NO_REPORTS = bytes(byte for byte in range(0x100) if byte not in REPORTING)
_NO_TEXT = bytes(byte for byte in range(0x20) if byte not in (*_ANSWERED, *BACKSPACE))


class Share:
    """The work done for one host."""

    def __init__(self, controller: SimulatedController) -> None:
        self._controller = controller
        self._cycle = controller.cycles
        self._lines = self._owed = 0
        self._turn_lines = self._turn_work = 0
        self.heavy = False

    @property
    def turn_over(self) -> bool:
        """Whether the host has used up its share of this turn."""
        return self._turn_lines >= LINES_PER_TURN or self._turn_work >= WORK_PER_TURN

    @property
    def work_over(self) -> bool:
        """Whether its work share of this turn is used up: not even the next command of a line is begun."""
        return self._turn_work >= WORK_PER_TURN

    @property
    def cycle_over(self) -> bool:
        """Whether it has used up its share of this background cycle."""
        return self._lines >= LINES_PER_CYCLE or self._owed >= WORK_PER_TURN

    def follow(self) -> None:
        """Record a background cycle; to be called in each of them."""
        if self._cycle != self._controller.cycles:
            self._cycle = self._controller.cycles
            self._lines = 0
            self._owed = max(0, self._owed - WORK_PER_CYCLE)

    def spend(self, work: int, lines: int = 0) -> None:
        """Record work done for the host."""
        self._owed += work
        self._lines += lines
        self._turn_work += work
        self._turn_lines += lines

    def end_turn(self) -> None:
        """Reset; `heavy` is whether this turn was a long one."""
        self.heavy = self._turn_work >= WORK_PER_TURN
        self._turn_lines = self._turn_work = 0


class Port:
    """Bytes in, bytes out. `service` is called once per background cycle, and whenever input has come.

    `lines` are the lines between the controller and its hosts, `share` limits its time for this one. Once the line
    is `lost`, its output is discarded. `on_board` is whether an Ethernet board is between this port and the line.
    """

    def __init__(self, controller: SimulatedController, lines: Lines) -> None:
        self.lines = lines
        self.lost = self.on_board = False
        self._way_in, self._way_out = LineDirection(lines, inward=True), LineDirection(lines, inward=False)
        self._controller = controller
        self._context = Context(controller)
        self.share = Share(controller)
        self._fresh = bytearray()
        self._reports = bytearray()
        self._queue = bytearray()
        self._line = bytearray()
        self._running: Generator[None, None, bool] | None = None
        self._running_line = b""
        self._last_line = b""
        self._overlong = False
        self._outbox = HostOutput(lines)

    @property
    def crowded(self) -> bool:
        """Whether more input is pending than allowed."""
        waiting = len(self._fresh) + len(self._reports) + len(self._queue)
        return waiting + self._way_in.waiting >= INBOX_LIMIT

    @property
    def saving(self) -> bool:
        """Whether the controller is in the seconds of a SAVE, in which it answers nothing."""
        return self._controller.saving

    @property
    def idle(self) -> bool:
        """Whether every complete line has been answered; half a line does not count."""
        if self._fresh or self._reports or self._running is not None or self._controller.saving:
            return False
        if self._way_in.waiting or self._way_out.waiting:
            return False
        return not any(part in self._queue for part in _ANSWERED)

    @property
    def ready(self) -> bool:
        """Whether `service` could make progress before the next background cycle."""
        if self._deaf or self.lines.slow:
            return False
        return bool(self._fresh or self._waiting) and self._may_continue()

    def receive(self, data: bytes) -> None:
        """Accept bytes, discard them when shut down. Raises LinkError: `link.lost`, the cable is cut."""
        self._refuse_lost()
        if self._way_in.clear:
            self._fresh += data
        elif not self.lines.dead:
            self.type(b"".join(self._way_in.carry((data,))))

    def type(self, data: bytes) -> None:
        """Accept bytes that have already arrived at the controller."""
        self._fresh += data

    def take_output(self) -> bytes:
        """Return and clear what has arrived at the host. Raises LinkError: `link.lost`, the cable is cut."""
        self._refuse_lost()
        said = [] if self._controller.saving else self._outbox.take()
        return b"".join(said if self._way_out.clear else self._way_out.carry(said))

    def take_said(self) -> bytes:
        """Return and clear the controller's output, before it is on the line of a host."""
        return b"" if self._controller.saving else b"".join(self._outbox.take())

    def power_up(self) -> None:
        """Restart: clear all earlier state."""
        self._fresh.clear()
        self._way_in.forget()
        self._clear()
        self._last_line = b""
        self._context = Context(self._controller)

    def announce(self, said: bytes) -> None:
        """Send the host an unsolicited message. It comes between two replies, or is lost."""
        if self._outbox.waiting < ANNOUNCED_LIMIT:
            self._outbox.say(said)

    def disconnect(self) -> None:
        """Handle a disconnect: a buffer that the host left open is closed, so that others can work."""
        if self._context.fills_buffer:
            self._controller.open_buffer = None

    def obey(self) -> None:
        """Act on the received control characters, before every pending line; keep the rest for later.

        They are executed in order. Only reports beyond the share of the host wait.
        """
        if self._way_in.waiting:
            self.type(b"".join(self._way_in.carry(())))
        if not self._fresh or self._deaf:
            return
        fresh = bytes(self._fresh)
        self._fresh.clear()
        if _AT_ONCE.search(fresh) is None:
            self._queue += fresh.translate(None, _NO_TEXT)
            return
        while not self._reports and (found := _REPORT.search(fresh)) is not None:
            self._take(fresh[: found.end()])
            fresh = fresh[found.end() :]
            if not self.share.turn_over and self._may_continue():
                self._report()
        self._take(fresh)

    def service(self) -> None:
        """Act on control characters at once, then execute the next few lines."""
        self.share.follow()
        self.obey()
        if not self._waiting or self._deaf:
            self.share.end_turn()
            return
        most = self._outbox.waiting + ANSWER_PER_TURN
        while not self.share.turn_over and self._outbox.waiting <= most and self._may_continue():
            if self._controller.saving:
                break  # the rest of the queue waits, and so does the rest of the line
            if self._reports:
                self._report()
            elif self._running is not None:
                self._continue()
            elif self._queue:
                self._take_apart()
            else:
                break
        self.share.end_turn()

    @property
    def _wording(self) -> replies.Wording:
        return replies.wording(self._controller.variables)

    @property
    def _deaf(self) -> bool:
        """Whether the controller takes nothing: it is hung, dead, or writes its flash memory."""
        return self.lines.silent or self._controller.saving

    @property
    def _waiting(self) -> bool:
        return bool(self._reports or self._queue) or self._running is not None

    def _may_continue(self) -> bool:
        """Whether this host has some share left in this cycle; the last item pending is always allowed."""
        if not self.share.cycle_over:
            return True
        found = _PART.search(self._queue)
        if self._reports or self._running is not None:
            return found is None and len(self._reports) + (self._running is not None) == 1
        return found is None or found.end() == len(self._queue)

    def _take(self, data: bytes) -> None:
        """Act on the stops and starts in a stretch, each once, in the order of their last occurrence.

        No time passes between them, so that only the last of the same kind has an effect.
        """
        for _, code in sorted((data.rfind(code), code) for code in ACTING if code in data):
            self._act(code)
        if CONTROL_X in data:
            # All earlier input and its replies are discarded.
            data = data[data.rfind(CONTROL_X) + 1 :]
            self._clear()
            if self._controller.variables.i(63):
                self._outbox.say(bytes((CONTROL_X,)))
        self._reports += data.translate(None, _NO_REPORTS)
        self._queue += data.translate(None, _NO_TEXT)

    def _report(self) -> None:
        said = self._act(self._reports.pop(0)) or ""
        self.share.spend(max(_REPORT_WORK, len(said) // _REPORTED_A_VALUE), lines=1)
        if answers(self._context):
            self._answer(said)

    def _act(self, code: int) -> str | None:
        if code in STOPS:
            self._controller.host.pending_commands.clear()
        try:
            return ACTIONS[code](self._context)
        except PmacError as refusal:
            self._outbox.reply(end=replies.error_reply(refusal.code, self._wording))
            return None

    def _clear(self) -> None:
        self._reports.clear()
        self._queue.clear()
        self._line.clear()
        self._running = None
        self._outbox.forget()
        self._way_out.forget()
        self._overlong = False

    def _take_apart(self) -> None:
        """Append to the line up to its end, or to a control character that edits the line itself."""
        found = _PART.search(self._queue)
        part = found[0] if found else b""
        end = found.start() if found else len(self._queue)
        self._add(bytes(self._queue[: min(end, LINE_LIMIT + 1)]))
        del self._queue[: end + len(part)]
        if self.lines.garblings and part in (b"\r", SUM):
            line = self.lines.read(bytes(self._line))
            self._overlong = self._overlong or len(line) > LINE_LIMIT
            self._line = bytearray(line[:LINE_LIMIT])
        if part == BACKSPACE:
            del self._line[-1:]
        elif part == SUM:
            self._outbox.reply(bytes((replies.checksum(self._line),)))
        elif part == RECALL:
            self.share.spend(len(self._last_line) // _REPORTED_A_VALUE)
            self._answer(self._last_line.decode("latin-1"))
        elif part == REPEAT and (self._line or self._context.fills_buffer):
            self._add(part)
        elif part:
            self._begin(self._last_line if part == REPEAT else bytes(self._line))

    def _add(self, text: bytes) -> None:
        room = LINE_LIMIT - len(self._line)
        self._overlong = self._overlong or len(text) > room
        self._line += text[:room]
        self.share.spend(_PART_WORK + len(text) // _CHARACTERS_A_VALUE)

    def _begin(self, line: bytes) -> None:
        overlong, self._overlong = self._overlong, False
        self._line.clear()
        self._running_line, self._last_line = line, line or self._last_line
        self.share.spend(0, lines=1)
        self._context.lines.clear()
        if overlong:
            refusal = PmacError(ErrorCode.DATA_ERROR, f"a line of more than {LINE_LIMIT} characters")
            self._end_line(refusal, heard=answers(self._context))
            return
        self._running = commands(line.decode("latin-1"), self._context)
        self._continue()

    def _continue(self) -> None:
        """Execute the remaining commands of the line, as far as the turn allows."""
        running, context, share = self._running, self._context, self.share
        assert running is not None
        refusal, heard = None, True
        try:
            while True:
                next(running)
                share.spend(context.work)
                context.work = 0
                if share.work_over or self._controller.saving:
                    # The replies so far are sent; the rest of the line gets its next turn.
                    self._outbox.begin(replies.data(context.lines, self._wording))
                    context.lines.clear()
                    return
        except StopIteration as done:
            heard = bool(done.value)
        except PmacError as refused:
            refusal = refused
        self._running = None
        share.spend(context.work)
        context.work = 0
        self._end_line(refusal, heard)

    def _end_line(self, refusal: PmacError | None, heard: bool) -> None:
        """Answer a line. This very line may have changed I3, I4 and I6; the reply follows the new values."""
        how = self._wording
        data, summed = replies.data(self._context.lines, how), how.checksums
        if self.on_board and self._controller.saving:
            return  # the board gives up over a SAVE: its client gets a NUL, and no acknowledgement afterwards
        if refusal is not None:
            self._outbox.reply(data, replies.error_reply(refusal.code, how), summed=summed)
        elif heard:
            checksum = bytes([replies.checksum(self._running_line)]) if summed else b""
            self._outbox.reply(data, how.acknowledgement, checksum, summed=summed)
        else:
            self._outbox.reply(data, summed=summed)

    def _answer(self, line: str) -> None:
        how = self._wording
        self._outbox.reply(replies.data((line,), how), summed=how.checksums)

    def _refuse_lost(self) -> None:
        if self.lost:
            raise LinkError(Problem(code="link.lost", where="memory", value="the cable is cut"))
