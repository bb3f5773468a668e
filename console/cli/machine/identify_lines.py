"""Identified response as a table for people, beside the machine profile's."""

from __future__ import annotations

import cmath
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from console.cli.machine.identify_fields import LEAST_COHERENCE, decibels, doubtful_points
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from console.text.columns import broken, pad_left
from drivers.identification.nominal import nominal_response, phase_difference_deg
from drivers.identification.request import IdentificationRequest
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, Origin
from profiles.files import printable
from profiles.machine import MachineProfile

WIDTH = 79

COLUMNS = (
    ("frequency", "Hz", 5),
    ("gain", "1", 7),
    ("confidence", "1", 7),
    ("gain", "dB", 7),
    ("phase", "deg", 8),
    ("confidence", "deg", 6),
    ("model", "1", 7),
    ("model", "deg", 8),
    ("difference", "%", 7),
    ("difference", "deg", 7),
    ("coherence", "1", 7),
)
"""Columns with their units and widths, fixed before the first value is known."""


class Teller:
    """Print the table row by row, as it is measured."""

    def __init__(
        self,
        machine: MachineProfile,
        request: IdentificationRequest,
        text: Catalogue,
        *,
        silent: bool,
        interruption: Interruption,
    ) -> None:
        """With `silent` nothing is printed. When the output can no longer be written, the machine is stopped."""
        self._machine, self._request, self._text = machine, request, text
        self._silent, self._interruption = silent, interruption

    def begin(self, origin: Origin) -> None:
        """Print what is about to be measured."""
        text, request = self._text, self._request
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
        names = _row([text(f"identify.column.{name}") for name, _, _ in COLUMNS])
        units = _row([unit for _, unit, _ in COLUMNS])
        self._print(mark + head, text("identify.how_to_stop"), "", names, units)

    def tell(self, point: IdentifiedPoint) -> None:
        """Print a row."""
        nominal = nominal_response(self._request.path, self._machine, point.frequency_hz)
        cells = [
            f"{point.frequency_hz:g}",
            f"{point.gain:.4f}",
            f"{point.gain_ci:.4f}",
            f"{decibels(point.gain):.2f}",
            f"{point.phase_deg:.2f}",
            f"{point.phase_ci_deg:.2f}",
            f"{abs(nominal):.4f}",
            f"{math.degrees(cmath.phase(nominal)):.2f}",
            f"{100.0 * (point.gain / abs(nominal) - 1.0):+.2f}",
            f"{phase_difference_deg(point.phase_deg, nominal):+.2f}",
            f"{point.coherence:.4f}",
        ]
        self._print(_row(cells) + ("" if point.coherence >= LEAST_COHERENCE else " !"))

    def end(self, identified: IdentifiedResponse, file: Path) -> list[str]:
        """Return the lines after the table."""
        text = self._text
        doubtful = doubtful_points(identified)
        said = [text(f"strategy.{identified.path}.{identified.how}", cycles=identified.delay_cycles)]
        if doubtful:
            listed = ", ".join(f"{point.frequency_hz:g}" for point in doubtful)
            said.append(text("identify.doubtful", frequencies=listed, limit=f"{LEAST_COHERENCE:g}"))
        lines = [line for sentence in said for line in broken(sentence, WIDTH)]
        return ["", *lines, text("identify.kept", file=printable(str(file)))]

    def _print(self, *lines: str) -> None:
        if self._silent:
            return
        try:
            print("\n".join(lines))
            sys.stdout.flush()
        except OSError:
            # The operator no longer sees the machine, so it must not continue.
            self._interruption.end("output closed")


def _row(cells: Sequence[str]) -> str:
    return "".join(pad_left(cell, width) for cell, (_, _, width) in zip(cells, COLUMNS, strict=True))
