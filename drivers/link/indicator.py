"""A digital indicator on a serial line: asked for one reading, which comes back as a number or as an error.

The formats are data: what is sent, what a reply looks like, and how the line is set. A reply counts only as a
whole: one line, of the documented form, alone on the line since it was asked for. All else is an error with the
bytes that came, never a number; nothing that comes from the line is used but that number and its unit.

Sources: the operating manuals of the interfaces (Mux-10 format in that of ASDQMS GageMux, `1` as its request and
911 and 912 as its errors in that of Mitutoyo IT-007R; Sylvac Power, Opto-RS; Mahr Millimar C1202, table 7.2; Metro
Mux4, chapters 9 and 11). None was tried with the instrument itself.
"""

from __future__ import annotations

import re
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from types import MappingProxyType

from drivers.errors import LinkError
from drivers.link.address import SerialAddress, parse_device
from drivers.link.serial import EIGHT_BITS, Framing, SerialLink
from profiles.files import printable
from profiles.problem import Problem

REPLY_S = 2.0  # within which a reply begins and ends
QUIET_S = 0.15  # without a character: nothing older is on its way, or a reply is over
DRAIN_S = 1.0  # for which a line may still bring what was sent before
MOST_BYTES = 64  # of a reply; the longest of a format has 28
UM = MappingProxyType({"um": 1.0, "mm": 1000.0, "in": 25_400.0, "inch": 25_400.0, "IN": 25_400.0})
"""The units of replies, in um."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IndicatorFormat:
    """How a kind of indicator is asked, and answers: patterns of a whole line without its end.

    `reply` has the group `value` and, where the instrument sends its unit, `unit`; else readings are in `unit`.
    A reply like `error` says that there is no reading.
    """

    request: bytes
    reply: str
    error: str
    unit: str = ""
    framing: Framing = EIGHT_BITS
    baud_rate: int = 9600


_SEVEN_EVEN_TWO = Framing(bits=7, parity="E", stop_bits=2)
_MUX10 = IndicatorFormat(
    request=b"1\r", reply=r"01A(?P<value>(?=.{9,10}$)[+-]\d+\.\d+)", error=r"9\d\d", unit="mm"
)
_OPTO = IndicatorFormat(
    request=b"?\r",
    reply=r"(?P<value>[+ -]\d{1,4}\.\d{2,6})[<=>]?",
    error=r"ERR\d",
    unit="mm",
    framing=_SEVEN_EVEN_TWO,
    baud_rate=4800,
)
FORMATS: Mapping[str, IndicatorFormat] = MappingProxyType(
    {
        "mux10-mm": _MUX10,
        "mux10-inch": replace(_MUX10, unit="inch"),
        "opto-mm": _OPTO,
        "opto-inch": replace(_OPTO, unit="inch"),
        "millimar": IndicatorFormat(
            request=b"M1?\r",
            reply=r"1 (?P<value>[+-]\d+\.\d+) (?P<unit>mm|um|inch)( [<=>]){0,2}",
            error=r"(1 )?ERR\d",
            framing=_SEVEN_EVEN_TWO,
        ),
        "mux4": IndicatorFormat(  # MIN and MAX are readings of another time
            request=b"1",
            reply=r"V1: (?P<unit>[A-Za-z/ ]{4}) (   |GO |ABS|REL|[+-]NG) (?P<value>[+ -]\d{5}\.\d{6})",
            error=r"N..?:E\d",
        ),
    }
)
FORM = f"/dev/NAME[?baud=RATE]:FORMAT, FORMAT = {' | '.join(FORMATS)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class IndicatorAddress:
    """The line of an indicator, and the name of its format."""

    line: SerialAddress
    format: str

    def __str__(self) -> str:
        return f"{self.line.device}?baud={self.line.baud_rate}:{self.format}"


@dataclass(frozen=True, slots=True, kw_only=True)
class IndicatorReading:
    """A reading and its last digit, um."""

    value_um: float
    resolution_um: float


def parse_indicator(text: str) -> IndicatorAddress:
    """Parse `/dev/NAME[?baud=RATE]:FORMAT`; without a rate it is that of the format.

    Raises `LinkError`: `indicator.bad_address`.
    """
    device, _, name = text.rpartition(":")
    if name not in FORMATS:
        raise _error("indicator.bad_address", value=printable(text, 80), limit=FORM)
    rated = device if "?" in device else f"{device}?baud={FORMATS[name].baud_rate}"
    try:
        return IndicatorAddress(line=parse_device(rated), format=name)
    except LinkError as error:
        raise _error("indicator.bad_address", value=printable(text, 80), limit=FORM) from error


def parse_reply(data: bytes, form: IndicatorFormat, where: str = "") -> IndicatorReading:
    """Return the reading in all bytes that a request has brought from `where`.

    Raises `LinkError`: `indicator.silent`, nothing; `indicator.error`, the instrument has no reading;
    `indicator.unit`, not in a length; `indicator.no_reading`, anything else.
    """
    text, shown = data.decode("ascii", "replace"), printable(data.decode("ascii", "backslashreplace"), 40)
    if not data:
        raise _error("indicator.silent", where, limit=f"{REPLY_S:g} s")
    whole = re.fullmatch(r"([^\r\n]+)(\r\n|\r|\n)", text)
    line = "" if whole is None else whole[1]
    if re.fullmatch(form.error, line, re.ASCII):
        raise _error("indicator.error", where, shown)
    found = re.fullmatch(form.reply, line, re.ASCII)
    if found is None:
        raise _error("indicator.no_reading", where, shown)
    unit = form.unit or found["unit"].strip()
    if unit not in UM:
        raise _error("indicator.unit", where, shown, "mm | um | inch")
    decimals = len(found["value"].partition(".")[2])
    return IndicatorReading(value_um=float(found["value"]) * UM[unit], resolution_um=UM[unit] * 10.0**-decimals)


def read_indicator(asked: IndicatorAddress) -> IndicatorReading:
    """Ask an indicator for one reading: at most `DRAIN_S` and `REPLY_S`. The line is opened for it alone.

    Raises `LinkError`: as for `open_line` and `parse_reply`; `link.lost`; `indicator.talks`, the line does not
    become quiet, so that no reply could be told from what was sent before.
    """
    form, where, data = FORMATS[asked.format], str(asked), b""
    with closing(SerialLink(asked.line, form.framing)) as line:
        until_s = time.monotonic() + DRAIN_S
        while line.receive(QUIET_S):
            if time.monotonic() > until_s:
                raise _error("indicator.talks", where, limit=f"{DRAIN_S:g} s")
        line.send(form.request)
        until_s = time.monotonic() + REPLY_S
        while len(data) <= MOST_BYTES and time.monotonic() < until_s:
            more = line.receive(QUIET_S)
            data += more
            if not more and data.endswith((b"\r", b"\n")):
                break
    return parse_reply(data, form, where)


def _error(code: str, where: str = "", value: str = "", limit: str = "") -> LinkError:
    return LinkError(Problem(code=code, where=where, value=value, limit=limit))
