"""Who controls the machine, in words, beside the number that decides it: a name, a computer, and since when.

The number alone has control (`ownership.py`); this only explains it. It is written by the console that has just
claimed the machine, and belongs to its number: with any other number in control it means nothing. A P-variable
holds integers of this size exactly in every family, so each takes three bytes of UTF-8.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivers.controller import Controller
from drivers.lathe.standing import MOST_OF_A_HOST, Signature
from drivers.pmac.reserved import SIGNATURE

BYTES = MOST_OF_A_HOST  # of the name, and of the computer; what is longer is cut at a character
_PER_VARIABLE = 3
_EACH = BYTES // _PER_VARIABLE
ITEMS = tuple(f"P{SIGNATURE + place}" for place in range(2 + 2 * _EACH))
"""Number, minute, name, computer."""


def sign(client: Controller, signature: Signature) -> None:
    """Write it, in one line. Nothing depends on it. Errors as for `request`."""
    client.request(signing_line(signature), lines=0)


def signing_line(signature: Signature) -> str:
    """Return the line that writes a signature."""
    values = (signature.number, signature.minute, *_packed(signature.name), *_packed(signature.host))
    return " ".join(f"{item}={value}" for item, value in zip(ITEMS, values, strict=True))


def read_signature(client: Controller, holder: int) -> Signature | None:
    """Return what the console `holder` has written, None where there is nothing of it. Errors as for `numbers`."""
    number, minute, *text = client.numbers(*ITEMS, again=True)
    if int(number) != holder or not 0 <= minute < 2**31:
        return None
    name, host = _unpacked(text[:_EACH]), _unpacked(text[_EACH:])
    return Signature(number=holder, name=name, host=host, minute=int(minute)) if name else None


def _packed(text: str) -> tuple[int, ...]:
    data = text.encode("utf-8", "replace")[:BYTES].decode("utf-8", "ignore").encode("utf-8").ljust(BYTES, b"\0")
    return tuple(int.from_bytes(data[at : at + _PER_VARIABLE], "big") for at in range(0, BYTES, _PER_VARIABLE))


def _unpacked(values: Sequence[float]) -> str:
    """Return the text of these variables; "" where they hold anything else."""
    if not all(0 <= value < 2 ** (8 * _PER_VARIABLE) and value == int(value) for value in values):
        return ""
    data = b"".join(int(value).to_bytes(_PER_VARIABLE, "big") for value in values)
    return data.rstrip(b"\0").decode("utf-8", "replace")
