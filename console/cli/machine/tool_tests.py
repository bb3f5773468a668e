"""Identification and health test of one machine: the one at the given address, or one in memory with --sim.

The identified response is shown beside that of the machine profile; angles in degrees.
"""

from __future__ import annotations

import cmath
import math
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeVar

from console.cli.library import data_of, machine_of, true_parameters_of
from console.cli.machine.stopping import StopMonitor
from console.cli.output import confirm_motion, show, tell
from console.session.cut.trip_cause import filter_suspected
from console.session.data import health, identified_responses
from console.session.data.kept_files import utc_now
from console.session.errors import SessionError
from console.session.signals import Interruption
from console.session.station.machine_address import address_of
from console.session.station.machine_connection import guard, leave, reach
from console.session.station.machine_control import MachineControl
from console.session.tuning.trial import TrialPlace, standing_trial
from console.text.catalogue import Catalogue
from console.text.columns import pad_left, table, wrap_text
from drivers.cutting.strategy import Strategy
from drivers.identification.health import (
    FIGURES,
    HealthRequest,
    HealthResult,
    check_health,
    figures_of,
    health_problems,
    model_figures_of,
)
from drivers.identification.identify import identify, origin_of, take_up
from drivers.identification.nominal import nominal_response, phase_difference_deg
from drivers.identification.request import IdentificationRequest, request_problems
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, ResponseOrigin
from drivers.identification.rig import Rig, refuse_unready
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.safety import safety_problems
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.link.tracing import Tracing
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import LoadedMachine

Result = TypeVar("Result")
LEAST_COHERENCE = 0.95
"""Coherence below which a point is marked as doubtful: the response is not due to the excitation alone."""

WIDTH = 79

COLUMNS = (
    ("frequency", "Hz", 5, "frequency_hz", "g"),
    ("gain", "1", 7, "gain", ".4f"),
    ("confidence", "1", 7, "gain_ci", ".4f"),
    ("gain", "dB", 7, "gain_db", ".2f"),
    ("phase", "deg", 8, "phase_deg", ".2f"),
    ("confidence", "deg", 6, "phase_ci_deg", ".2f"),
    ("model", "1", 7, "nominal_gain", ".4f"),
    ("model", "deg", 8, "nominal_phase_deg", ".2f"),
    ("difference", "%", 7, "gain_difference_percent", "+.2f"),
    ("difference", "deg", 7, "phase_difference_deg", "+.2f"),
    ("coherence", "1", 7, "coherence", ".4f"),
)
"""Columns with their units and widths, fixed before the first value is known; the value and its format."""


def response_fields(identified: IdentifiedResponse, machine: MachineProfile, file: Path) -> dict[str, object]:
    """Return the result with all its points, nothing rounded; lengths in um."""
    return {
        **asdict(identified.origin),
        "path": identified.path.value,
        "how": identified.how,
        "delay_cycles": identified.delay_cycles,
        "date": identified.date,
        "file": str(file),
        "points": [_point_fields(point, identified.path, machine) for point in identified.points],
        "doubtful_hz": _doubtful_hz(identified),
    }


def _doubtful_hz(identified: IdentifiedResponse) -> list[float]:
    return [point.frequency_hz for point in identified.points if point.coherence < LEAST_COHERENCE]


def _point_fields(point: IdentifiedPoint, path: Strategy, machine: MachineProfile) -> dict[str, float]:
    nominal = nominal_response(path, machine, point.frequency_hz)
    return {
        **asdict(point),
        "gain_db": 20.0 * math.log10(max(point.gain, 1e-12)),
        "nominal_gain": abs(nominal),
        "nominal_phase_deg": math.degrees(cmath.phase(nominal)),
        "gain_difference_percent": 100.0 * (point.gain / abs(nominal) - 1.0),
        "phase_difference_deg": phase_difference_deg(point.phase_deg, nominal),
    }


@dataclass
class Teller:
    """Print the table row by row, as it is measured; nothing where `silent`.

    When the output can no longer be written, the machine is stopped.
    """

    machine: MachineProfile
    request: IdentificationRequest
    text: Catalogue
    silent: bool
    interruption: Interruption
    rows: int = 0

    def begin(self, origin: ResponseOrigin) -> None:
        """Print what is about to be measured."""
        text, request = self.text, self.request
        mark = f"{text('sim')}  " if origin.simulated else ""
        head = text(
            "identify.head",
            machine=origin.machine,
            kind=origin.kind,
            version=origin.version,
            path=request.path,
            amplitude=f"{request.amplitude_um:g}",
            periods=request.periods,
        )
        self._print(mark + head, text("identify.how_to_stop"))

    def tell(self, point: IdentifiedPoint) -> None:
        """Print a row, the first with the head of the table: what is refused before has none."""
        if not self.rows:
            names = _row([self.text(f"identify.column.{name}") for name, *_ in COLUMNS])
            self._print("", names, _row([unit for _, unit, *_ in COLUMNS]))
        self.rows += 1
        values = _point_fields(point, self.request.path, self.machine)
        row = _row([format(values[key], form) for *_, key, form in COLUMNS])
        self._print(row + ("" if point.coherence >= LEAST_COHERENCE else " !"))

    def end(self, identified: IdentifiedResponse, file: Path) -> list[str]:
        """Return the lines after the table."""
        text, doubtful_hz = self.text, _doubtful_hz(identified)
        sentences = [text(f"strategy.{identified.path}.{identified.how}", cycles=identified.delay_cycles)]
        if doubtful_hz:
            listed = ", ".join(f"{hz:g}" for hz in doubtful_hz)
            sentences.append(text("identify.doubtful", frequencies=listed, limit=f"{LEAST_COHERENCE:g}"))
        lines = [line for sentence in sentences for line in wrap_text(sentence, WIDTH)]
        return ["", *lines, text("identify.kept", file=printable(str(file)))]

    def _print(self, *lines: str) -> None:
        if self.silent:
            return
        try:
            print("\n".join(lines))
            sys.stdout.flush()
        except OSError:
            # The operator no longer sees the machine, so it must not continue.
            self.interruption.end("output closed")


def _row(cells: Sequence[str]) -> str:
    return "".join(pad_left(cell, width) for cell, (_, _, width, *_) in zip(cells, COLUMNS, strict=True))


def identify_and_keep(options: Namespace, interruption: Interruption, text: Catalogue) -> int:
    """Identify, print and keep the result; 1 without consent to move a machine."""
    loaded = machine_of(options)
    machine = loaded.machine
    request = _request(options, machine)
    teller = Teller(machine, request, text, silent=options.json, interruption=interruption)

    def work(rig: Rig, origin: ResponseOrigin) -> IdentifiedResponse:
        teller.begin(origin)
        take_up(rig)
        return identify(rig, request, origin, utc_now(), teller.tell)

    def refuse(rig: Rig) -> None:
        refuse_unready(rig, request_problems(request, rig.machine))

    identified = work_agreed(options, loaded, interruption, text, refuse, work)
    if identified is None:
        return 1
    file = identified_responses.store(data_of(options), identified)
    show(options, lambda: response_fields(identified, machine, file), lambda: teller.end(identified, file))
    return 0


def _request(options: Namespace, machine: MachineProfile) -> IdentificationRequest:
    """Return the request; refuse an impossible one before anything is opened."""
    given = {"frequencies_hz": options.frequencies, "amplitude_um": options.amplitude, "periods": options.periods}
    wanted = {name: value for name, value in given.items() if value is not None}
    request = IdentificationRequest(path=Strategy(options.strategy), **wanted)
    if problems := request_problems(request, machine):
        raise SessionError(*problems)
    return request


@contextmanager
def reached_machine(
    options: Namespace, loaded: LoadedMachine, interruption: Interruption, tracing: Tracing, text: Catalogue
) -> Iterator[tuple[Rig, MachineControl, bool]]:
    """Connect to the machine, and yield whether it is simulated; print on stderr how one at an address stops."""
    if options.sim:
        rig = _in_memory(options, loaded.machine, interruption, tracing)
        yield rig, MachineControl(rig.lathe, "", data_of(options)), True
        return
    address = address_of(loaded.machine, options.link, simulated=False)
    stopping = StopMonitor(interruption, text)
    reached = reach(loaded, address, data_of(options), tracing, stopping.note_reply)
    try:
        with stopping.watching(reached.stop):
            rig = Rig(client=reached.client, lathe=reached.lathe, clock=reached.clock)
            yield rig, reached.owning, reached.simulated
    finally:
        reached.close()


def _in_memory(options: Namespace, machine: MachineProfile, interruption: Interruption, tracing: Tracing) -> Rig:
    """Return a simulated machine that runs as fast as it can be calculated."""
    simulated = SimulatedLathe(machine, true_parameters_of(options, machine))
    link = tracing.trace_link(MemoryLink(simulated.connect(), simulated), simulated.now_s)
    stop, client = StopPath(link), PmacClient(link, simulated)
    interruption.guard(stop)
    lathe = Lathe(client, machine, simulated, stop, heartbeat=Heartbeat(client, simulated, machine))
    return Rig(client=client, lathe=lathe, clock=simulated)


def work_agreed(
    options: Namespace,
    loaded: LoadedMachine,
    interruption: Interruption,
    text: Catalogue,
    refuse: Callable[[Rig], None],
    work: Callable[[Rig, ResponseOrigin], Result],
) -> Result | None:
    """Reach the machine, ask for consent, and work; None without consent to move it."""
    name = loaded.machine.name
    tracing = Tracing(None if options.trace is None else Path(options.trace), f"{options.command} {name}")
    try:
        with reached_machine(options, loaded, interruption, tracing, text) as (rig, owning, simulated):
            guard(interruption, rig.lathe, rig.clock.now_s)
            if not simulated:
                rig.lathe.connect()
                # Nothing is sent and no control is taken before consent: the answer may take time.
                if not confirm_motion(options, name, False, text):
                    return None
            return with_origin(rig, owning, simulated, data_of(options), refuse, work)
    finally:
        tell(tracing.problems, text)


def with_origin(
    rig: Rig,
    owning: MachineControl,
    simulated: bool,
    data: Path,
    refuse: Callable[[Rig], None],
    work: Callable[[Rig, ResponseOrigin], Result],
) -> Result:
    """Take control, refuse what must not be, and work; the machine is left at rest, drives off, released.

    Where the tool trips in the work with a notch filter, it is told that its coefficients may be read otherwise.
    """
    version, kind = rig.lathe.connect()
    if not simulated and (unsafe := safety_problems(rig.machine, rig.lathe.snapshot().inputs)):
        raise SessionError(*unsafe)
    owning.claim()
    try:
        if rig.lathe.ownership is not None:
            rig.lathe.on_trial = _trial_gains(rig, data, simulated)
        refuse(rig)
        try:
            return work(rig, origin_of(rig, version=version, kind=kind, simulated=simulated))
        except ProblemError as error:
            if suspected := filter_suspected(rig.lathe, error.problems):
                raise SessionError(*error.problems, *suspected) from error
            raise
    finally:
        leave(rig.lathe, owning)


def _trial_gains(rig: Rig, data: Path, simulated: bool) -> dict[str, float]:
    """Return the gains on trial that stand in the controller as they were applied: they are tested then."""
    place = TrialPlace(client=rig.client, machine=rig.lathe.machine, data=data, simulated=simulated)
    trial = standing_trial(place, settle=True)
    return {} if trial is None or not trial.whole else dict(trial.proposed)


NOTHING = "-"


def check_and_keep(options: Namespace, interruption: Interruption, text: Catalogue) -> int:
    """Test, print and keep the result; 1 without consent to move a machine."""
    loaded, data = machine_of(options), data_of(options)
    request = HealthRequest() if options.step is None else HealthRequest(step_um=options.step)
    if problems := health_problems(request, loaded.machine):
        raise SessionError(*problems)

    def work(rig: Rig, origin: ResponseOrigin) -> HealthResult:
        take_up(rig)
        return check_health(rig, request, origin, utc_now())

    def refuse(rig: Rig) -> None:
        refuse_unready(rig, health_problems(request, rig.machine))

    result = work_agreed(options, loaded, interruption, text, refuse, work)
    if result is None:
        return 1
    kept = health.kept_tests(data, loaded.machine.name, 1)
    before = kept[0].result if kept else None
    file = health.store(data, result)
    show(options, lambda: {**asdict(result), "file": str(file)}, lambda: _lines(result, before, file, text))
    return 0


def _lines(result: HealthResult, before: HealthResult | None, file: Path, text: Catalogue) -> list[str]:
    """Return the figures beside those of the model and of the test before."""
    columns = ("figure", "measured", "model", "before")
    found, model = figures_of(result), model_figures_of(result)
    last = {} if before is None else figures_of(before)
    rows = [tuple(text(f"health.column.{name}") for name in columns)]
    for key in FIGURES:
        values = (f"{each[key]:.4g}" if key in each else NOTHING for each in (found, model, last))
        rows.append((text(f"health.{key}"), *values))
    mark = f"{text('sim')}  " if result.origin.simulated else ""
    head = text("health.head", machine=result.origin.machine, step=f"{result.step_um:g}")
    return [mark + head, "", *table(rows, numeric=(1, 2, 3)), "", text("identify.kept", file=printable(str(file)))]
