"""The simulated lathe as a process of its own, seen from the one that starts it.

The controller is connected by a serial line, like a real one. An operator's actions in the shop (clamp a blank,
look at the chuck, put the part on the gauge) use a private channel, see `drivers.simulator.__main__`.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import IO, TYPE_CHECKING, Any

from drivers.errors import LinkError
from drivers.lathe_placement import LathePlacement, placed_text
from drivers.link.address import SerialAddress
from drivers.simulator.hosts.control_address import LONGEST_LINE
from drivers.simulator.hosts.pty import remove_name
from drivers.simulator.hosts.real_time import ASKED
from drivers.simulator.plant.which_lathe import WhichLathe
from drivers.simulator.plant.workshop_view import Dials, Truth, WorkshopView
from profiles.compensations.trial_band import BandReadings
from profiles.files import printable
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.metrology.cylindricity import PartSection
from profiles.problem import Problem
from profiles.strict_values import from_json, record

if TYPE_CHECKING:
    from profiles.traces import Trace


REQUEST_TIMEOUT_S = 5.0
END_TIMEOUT_S = 2.0
CHUNK = 65_536
LAST_WORDS_BYTES = 2000


class Child:
    """The process, its channel and its error output. Methods raise `OSError` and `ValueError`."""

    def __init__(self, arguments: list[str]) -> None:
        # A file instead of a pipe: nothing reads it in normal operation, and it must not block then.
        self._complaints: IO[bytes] = tempfile.TemporaryFile()
        self._channel, theirs = socket.socketpair()
        self._kept = b""
        self._is_copy = False  # what serves is no child of ours, but of one that was
        # -P: do not import modules from the current folder.
        command = [sys.executable, "-P", "-m", "drivers.simulator", "--channel", str(theirs.fileno()), *arguments]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._complaints,
                pass_fds=(theirs.fileno(),),
                start_new_session=True,
            )
        except OSError:
            self._channel.close()
            self._complaints.close()
            raise
        finally:
            theirs.close()

    @property
    def alive(self) -> bool:
        """Whether it has not ended."""
        return not self._is_closed() if self._is_copy else self._process.poll() is None

    def ask(self, request: dict[str, Any], copies: list[FrozenCopy] | None = None) -> dict[str, Any]:
        """Send a request and return the reply; `copies` gets those that come with it."""
        self._channel.settimeout(REQUEST_TIMEOUT_S)
        self._channel.sendall(json.dumps(request).encode("ascii") + b"\n")
        return self.read(REQUEST_TIMEOUT_S, copies)

    def turn_to(self, channel: socket.socket, timeout_s: float) -> str:
        """Go on with the process at the other end of this channel; the one before ends. Return the device."""
        before, self._channel, self._kept = self._channel, channel, b""
        try:
            device = str(self.read(timeout_s)["ready"])
        except (OSError, ValueError, KeyError) as error:
            channel.close()
            self._channel = before
            raise ConnectionError(format_error(error)) from error
        before.close()
        if not self._is_copy:
            self._wait()
        self._is_copy = True
        return device

    def read(self, timeout_s: float, copies: list[FrozenCopy] | None = None) -> dict[str, Any]:
        """Return the next message; `copies` gets those that come with it."""
        deadline = time.monotonic() + timeout_s
        while b"\n" not in self._kept:
            left_s = deadline - time.monotonic()
            if left_s <= 0.0:
                raise TimeoutError("no answer")
            self._channel.settimeout(left_s)
            if copies is None:
                data = self._channel.recv(CHUNK)  # a copy that nobody asked for is closed by the system
            else:
                data, lines, _, _ = socket.recv_fds(self._channel, CHUNK, 1)
                copies += [FrozenCopy(socket.socket(fileno=line)) for line in lines]
            if not data:
                raise ConnectionError("ended")
            self._kept += data
        line, _, self._kept = self._kept.partition(b"\n")
        said = from_json(line)
        if not isinstance(said, dict):
            raise ValueError("no answer")
        return said

    def end(self, cause: Exception) -> str:
        """End it, and return the reason: the last line of its error output, if any, otherwise `cause`."""
        if self._is_copy:
            self._end_copy()
        self._channel.close()
        self._wait()
        with self._complaints as complaints:
            left = max(os.fstat(complaints.fileno()).st_size - LAST_WORDS_BYTES, 0)
            words = os.pread(complaints.fileno(), LAST_WORDS_BYTES, left).decode("utf-8", "replace").split("\n")
        return next((printable(line) for line in reversed(words) if line.strip()), format_error(cause))

    def _wait(self) -> None:
        """Wait until our own child has ended, and kill it if it does not."""
        try:
            self._process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(END_TIMEOUT_S)

    def _end_copy(self) -> None:
        """Wait until the copy has closed its end, and kill all that is left of its session if it does not."""
        with suppress(OSError):
            self._channel.shutdown(socket.SHUT_WR)
            self._channel.settimeout(END_TIMEOUT_S)
            while self._channel.recv(CHUNK):
                pass
            return
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def _is_closed(self) -> bool:
        """Whether the other end of the channel is closed: it belongs to the copy alone."""
        self._channel.setblocking(False)
        try:
            return self._channel.recv(1, socket.MSG_PEEK) == b""
        except BlockingIOError:
            return False
        except OSError:
            return True


class FrozenCopy:
    """A checkpoint: the line to a process that waits, see `real_time`."""

    def __init__(self, line: socket.socket) -> None:
        self._line = line

    def thaw_copy(self, timeout_s: float) -> socket.socket:
        """Return the channel to a fresh copy that continues. Raises OSError."""
        self._line.settimeout(timeout_s)
        self._line.sendall(ASKED)
        said, channels, _, _ = socket.recv_fds(self._line, 1, 1)
        if said != ASKED or not channels:
            raise ConnectionError("ended")
        return socket.socket(fileno=channels[0])

    def close(self) -> None:
        """Let it end."""
        self._line.close()


def format_error(error: Exception) -> str:
    """Return what an error says, without its number."""
    return (isinstance(error, OSError) and error.strerror) or str(error)


class SimulatorProcess:
    """One running simulator. It is used from one thread, and ends with the process that started it."""

    def __init__(
        self, child: Child, address: SerialAddress, which: WhichLathe, parts: int, *, parts_differ: bool
    ) -> None:
        """Use `start` instead; `parts` were clamped so far."""
        self.address, self.which, self.parts, self.parts_differ = address, which, parts, parts_differ
        self._child = child
        self._over = ""
        self._frozen: dict[str, FrozenCopy] = {}
        self._looked: tuple[dict[str, Any], WorkshopView] | None = None

    @classmethod
    def start(
        cls,
        machine_path: Path,
        timeout_s: float = 20.0,
        *,
        seed: int | None = None,
        plant: str = "mounted",
        clamping_sd_percent: float | None = None,
        blind: bool = False,
        placed: LathePlacement | None = None,
        parts_before: int = 0,
    ) -> SimulatorProcess:
        """Start a simulator of the machine profile in a file and wait until it accepts connections.

        Chuck and tool are mounted at random, and the simulated hardware is that of `plant` (see `plant_named`);
        with a `seed`, the same each time. A `blind` one shows dials instead of the truth. It begins at power-up,
        or as it is `placed`, and continues with the draws of its parts after `parts_before`.

        Raises LinkError: `simulator.not_started`.
        """
        plant = os.path.abspath(plant) if plant.endswith(".toml") else plant
        arguments = ["--machine", os.path.abspath(machine_path), "--plant", plant]
        arguments += ["--clamping-sd", repr(clamping_sd_percent)] if clamping_sd_percent is not None else []
        arguments += ["--blind"] if blind else []
        arguments += [] if placed is None else ["--placed", placed_text(placed)]
        arguments += ["--parts-before", str(parts_before)] if parts_before else []
        arguments += [] if seed is None else ["--seed", str(seed)]
        child: Child | None = None
        try:
            child = Child(arguments)
            said = child.read(timeout_s)
            address, which = SerialAddress(device=str(said["ready"])), record(WhichLathe, said["lathe"])
            differ = said["parts_differ"] is True
        except (OSError, ValueError, KeyError, TypeError) as error:
            reason = child.end(error) if child else format_error(error)
            where = printable(str(machine_path))
            raise LinkError(Problem(code="simulator.not_started", where=where, value=reason)) from error
        return cls(child, address, which, parts_before, parts_differ=differ)

    def mount(self, job: Job) -> None:
        """Clamp a new blank for a job. Raises LinkError: `simulator.gone`, `simulator.refused`."""
        self._ask("mount", job={key: value for key, value in asdict(job).items() if value is not None})
        self.parts += 1

    def measure(self, *, turned_deg: float = 0.0) -> Trace:
        """Release the part; take its trace, turned on the gauge.

        Raises LinkError: `simulator.gone`; `simulator.refused`, no part.
        """
        import numpy as np

        from profiles.traces import Trace

        said = self._ask("measure", turned_deg=turned_deg)
        angle_deg = np.array(said["angle_deg"], dtype=np.float64)
        deviation_um = np.array(said["deviation_um"], dtype=np.float64)
        for column in (angle_deg, deviation_um):
            column.setflags(write=False)
        return Trace(angle_deg=angle_deg, deviation_um=deviation_um, meta=MappingProxyType(said["meta"]))

    def sections(self) -> tuple[PartSection, ...]:
        """Return sections of the measured part. Raises LinkError: `simulator.gone`; `simulator.refused`."""
        import numpy as np

        from profiles.metrology.cylindricity import PartSection

        said = self._ask("sections")
        angle_deg = np.array(said["angle_deg"], dtype=np.float64)
        return tuple(
            PartSection(z_mm=each["z_mm"], angle_deg=angle_deg, deviation_um=np.array(each["deviation_um"]))
            for each in said["sections"]
        )

    def look(self) -> WorkshopView:
        """Return what an operator sees at the chuck. Raises LinkError: `simulator.gone`."""
        said = self._ask("look")
        before = self._looked
        if before is not None and said == before[0]:
            return before[1]
        dials = None if said["dials"] is None else Dials(**said["dials"])
        view = WorkshopView(**{**said, "collisions": tuple(said["collisions"]), "dials": dials})
        self._looked = said, view
        return view

    def held_s(self) -> float:
        """Return by how much the lathe has held its time in all, while its computer was busy."""
        return self.look().held_s

    def indicate(self, places: int | None = None) -> ClampReadings:
        """Return what an indicator on the part shows of its clamping, see `SimulatedWorkshop.indicate`.

        Raises LinkError: `simulator.gone`; `simulator.refused`, no part.
        """
        return record(ClampReadings, self._ask("indicate", places=places))

    def indicate_band(self, behind_face_mm: float) -> BandReadings:
        """Return what an indicator shows of the clamped part, see `SimulatedWorkshop.indicate_band`.

        Raises LinkError: `simulator.gone`; `simulator.refused`, no part.
        """
        return record(BandReadings, self._ask("indicate_band", behind_face_mm=behind_face_mm))

    def truth(self) -> Truth:
        """Return the true values at the lathe, for a debrief. Raises LinkError: `simulator.gone`."""
        return Truth(**self._ask("truth"))

    def set_spindle(self, rpm: float | None) -> None:
        """Set a spindle on an inverter as at the lathe: it ramps to `rpm`, or coasts where that is None.

        Raises:
            LinkError: `simulator.gone`; `simulator.refused`, the controller drives this spindle, or not as fast.
        """
        self._ask("spindle", rpm=rpm)

    def fault(self, line: str) -> str:
        """Send a fault command; return the reply. Raises LinkError: `simulator.gone`, `simulator.refused`."""
        if len(line.encode("utf-8", "replace")) > LONGEST_LINE:
            raise self._error("simulator.refused", "fault", f"a line has at most {LONGEST_LINE} bytes")
        return str(self._ask("fault", line=line)["said"])

    def set_speed(self, speed: float) -> None:
        """Let time run this many times as fast as real time, 0 not at all. Raises LinkError: `simulator.gone`."""
        self._ask("pace", speed=speed)

    def checkpoint(self, name: str) -> None:
        """Freeze a copy of the lathe as it is now, instead of one of the same name.

        Raises LinkError: `simulator.gone`; `simulator.refused`, the system has no room for it.
        """
        copies: list[FrozenCopy] = []
        self._ask("checkpoint", copies)
        if not copies:
            raise self._error("simulator.refused", "checkpoint", "no copy")
        if name in self._frozen:
            self._frozen.pop(name).close()
        self._frozen[name] = copies[0]

    def return_to(self, name: str) -> None:
        """Go on with a copy of what was frozen, at another `address`; its time stands still until `set_speed`.

        Raises LinkError: `simulator.gone`; `simulator.refused`, there is no such copy, and nothing has changed.
        """
        try:
            channel = self._frozen[name].thaw_copy(REQUEST_TIMEOUT_S)
            before, device = self.address.device, self._child.turn_to(channel, REQUEST_TIMEOUT_S)
        except KeyError as error:
            raise self._error("simulator.refused", "return", name) from error
        except (OSError, ValueError) as error:
            raise self._error("simulator.refused", "return", format_error(error)) from error
        self.address = SerialAddress(device=device)
        remove_name(before)

    @property
    def alive(self) -> bool:
        """Whether the process still runs; one that has ended comes back only with a new console."""
        return not self._over and self._child.alive

    def close(self) -> None:
        """Ask the process to end, and kill it if it does not. Safe to call twice."""
        if not self._over:
            self._end(ConnectionError("closed"))

    def _ask(self, what: str, copies: list[FrozenCopy] | None = None, **content: Any) -> dict[str, Any]:
        """Send a request; return the reply, with the copies that come with it."""
        if self._over:
            raise self._error("simulator.gone", what, self._over)
        try:
            said = self._child.ask({"do": what, **content}, copies)
        except (OSError, ValueError) as error:
            # A late reply may still come: later replies would no longer match their requests.
            self._end(error)
            raise self._error("simulator.gone", what, self._over) from error
        if "refused" in said:
            raise self._error("simulator.refused", what, str(said["refused"]))
        return said

    def _end(self, cause: Exception) -> None:
        """Kill the process; a name left behind would lead to whoever gets that pseudo-terminal next."""
        for copy in self._frozen.values():
            copy.close()
        self._over = self._child.end(cause)
        remove_name(self.address.device)

    def _error(self, code: str, what: str, reason: str) -> LinkError:
        return LinkError(Problem(code=code, where=str(self.address), key=what, value=reason))
