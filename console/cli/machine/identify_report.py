"""Identified response beside the machine profile's, as a table for people and for JSON; angles in degrees."""

from __future__ import annotations

import cmath
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from console.text.columns import broken, pad_left
from drivers.cutting.strategy import Strategy
from drivers.identification.nominal import nominal_response, phase_difference_deg
from drivers.identification.request import IdentificationRequest
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, Origin
from profiles.files import printable
from profiles.machine import MachineProfile

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

    def begin(self, origin: Origin) -> None:
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
        lines = [line for sentence in sentences for line in broken(sentence, WIDTH)]
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
