"""X3P files (ISO 25178-72) with one profile: a zip archive with `main.xml` and the heights, inside or beside it.

`Record1` has the feature (`PRF`) and the axes: X incremental with its step in m, Z absolute; a stored integer
times the increment of Z is a height in m, a stored float is one. `Record3` has the dimensions and the heights, as
text in `DataList` or in the binary file that `DataLink` names. Heights of the type `F` or `D` with an increment
other than 1 are refused: the schema of the first edition has it for integers, the amendment for all types.

Nothing is unpacked to the disk, no more than the caps is ever unpacked, and a document type (where entities are
declared) is refused, whatever encoding the document says it has.
"""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from profiles.files import printable
from profiles.trace_files.closed_profile import (
    ABOVE_ZERO,
    UM_PER_M,
    ClosedProfile,
    TraceFormat,
    close_profile,
    heights_um,
    number,
    point_count,
    unusable,
)
from profiles.trace_files.limits import MOST_POINTS, too_large

_MEMBER = b"PK\x01\x02"
_BEGINNING = b"PK\x03\x04"
XML_CAP_BYTES = 10_000_000
DATA_CAP_BYTES = 8 * MOST_POINTS
MOST_MEMBERS = 1000
MOST_ELEMENTS = MOST_POINTS + 1000
MOST_ATTRIBUTES = 1000
LONGEST_ATTRIBUTE = 300  # characters: that of a namespace is repeated in every name below it
_TYPES = {"I": "<i2", "L": "<i4", "F": "<f4", "D": "<f8"}
_INTEGERS = ("I", "L")
# The errors of `zipfile` for an archive that is broken, encrypted, or packed by an unknown method.
_DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, ValueError)
_QUOTED = re.compile(r"""=\s*(?:"[^"]*"|'[^']*')""")

_Element = ElementTree.Element


def read_x3p(content: bytes, where: str) -> ClosedProfile:
    """Return the profile in the bytes of an X3P file.

    Raises `ProfileError`: `trace.format`, not such an archive, or not one profile at equal steps;
    `trace.too_large`, a part of it exceeds its cap; and what `profiles.trace_files.closed_profile.heights_um`
    refuses.
    """
    if (members := content.count(_MEMBER)) > MOST_MEMBERS:  # each uses memory before any is opened
        raise unusable(where, "X3P", f"{members} files", f"<= {MOST_MEMBERS} files")
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
    except _DAMAGED as error:
        raise unusable(where, "X3P", str(error), "zip") from error
    with archive:
        root = _document(_member(archive, "main.xml", XML_CAP_BYTES, where), where)
        _expect(root, "Record1/FeatureType", ("PRF",), where)
        for axis, kind in (("CX", "I"), ("CY", "I"), ("CZ", "A")):
            _expect(root, f"Record1/Axes/{axis}/AxisType", (kind,), where)
        step_m = number(_element_text(root, "Record1/Axes/CX/Increment"), "CX/Increment", where, ABOVE_ZERO, 1.0)
        points = point_count(_element_text(root, "Record3/MatrixDimension/SizeX"), "SizeX", where)
        for size in ("SizeY", "SizeZ"):
            _expect(root, f"Record3/MatrixDimension/{size}", ("1",), where)
        listed = _find_element(root, "Record3/DataList")
        heights = _read_binary_points(archive, root, points, where) if listed is None else _datums(listed, where)
        return close_profile("X3P", heights_um(heights, _scale_um(root, where), points), points, step_m, where)


def _member(archive: zipfile.ZipFile, name: str, cap_bytes: int, where: str) -> bytes:
    """Return one file of the archive; the size in its directory is not trusted."""
    shown = printable(name, 60)
    try:
        with archive.open(name) as file:
            content = file.read(cap_bytes + 1)
    except KeyError as error:
        raise unusable(where, "X3P", "-", shown) from error
    except _DAMAGED as error:
        raise unusable(where, shown, str(error), "zip") from error
    if len(content) > cap_bytes:
        raise too_large(f"{where}: {shown}", f"> {cap_bytes} bytes", f"{cap_bytes} bytes")
    return content


def _document(content: bytes, where: str) -> _Element:
    """Return the root of main.xml, parsed from text, so that no declared encoding can hide anything."""
    try:
        text = content.decode("utf-8-sig")
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise unusable(where, "main.xml", "<!DOCTYPE", "<p:ISO5436_2>")
        _refuse_swelling(text, where)
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise unusable(where, "main.xml", str(error), "XML, UTF-8") from error
    if _name(root) != "ISO5436_2":
        raise unusable(where, "main.xml", _name(root), "<p:ISO5436_2>")
    return root


def _refuse_swelling(text: str, where: str) -> None:
    """Refuse a document that would use far more memory than its length."""
    # Each element has a `<`, and all but empty ones another; each attribute has a `=`.
    elements = text.count("<") - text.count("</")
    attributes = text.count("=")
    longest = max((len(found.group()) for found in _QUOTED.finditer(text)), default=0)
    for actual, most, unit in (
        (elements, MOST_ELEMENTS, "elements"),
        (attributes, MOST_ATTRIBUTES, "attributes"),
        (longest, LONGEST_ATTRIBUTE, "characters in an attribute"),
    ):
        if actual > most:
            raise too_large(f"{where}: main.xml", f"{actual} {unit}", f"{most} {unit}")


def _name(element: _Element) -> str:
    return element.tag.rpartition("}")[2]


def _find_element(root: _Element, path: str) -> _Element | None:
    found: _Element | None = root
    for name in path.split("/"):
        found = next((each for each in found if _name(each) == name), None) if found is not None else None
    return found


def _element_text(root: _Element, path: str) -> str:
    found = _find_element(root, path)
    return "" if found is None or found.text is None else found.text.strip()


def _expect(root: _Element, path: str, allowed: tuple[str, ...], where: str) -> str:
    said = _element_text(root, path)
    if said not in allowed:
        raise unusable(where, path, said, ", ".join(allowed))
    return said


def _scale_um(root: _Element, where: str) -> float:
    integer = _expect(root, "Record1/Axes/CZ/DataType", tuple(_TYPES), where) in _INTEGERS
    stated = _element_text(root, "Record1/Axes/CZ/Increment") or "1"
    return number(stated, "CZ/Increment", where, *((ABOVE_ZERO, 1.0) if integer else (1.0, 1.0))) * UM_PER_M


def _datums(listed: _Element, where: str) -> Iterator[tuple[str, str]]:
    for place, each in enumerate(listed, start=1):
        yield f"{where}: Datum {place}", (each.text or "").strip() or "BAD"


def _read_binary_points(
    archive: zipfile.ZipFile, root: _Element, points: float, where: str
) -> Iterator[tuple[str, str]]:
    """Return the numbers of the binary file as text, with their places; those marked as not measured are BAD."""
    link, valid = (
        _element_text(root, f"Record3/DataLink/{name}") for name in ("PointDataLink", "ValidPointsLink")
    )
    content = _member(archive, link, DATA_CAP_BYTES, where)
    kind = np.dtype(_TYPES[_expect(root, "Record1/Axes/CZ/DataType", tuple(_TYPES), where)])
    if len(content) != points * kind.itemsize:
        raise unusable(where, printable(link, 60), f"{len(content)} bytes", f"{points * kind.itemsize:g} bytes")
    measured = np.ones(int(points), dtype=np.uint8)
    if valid:
        bits = np.frombuffer(_member(archive, valid, DATA_CAP_BYTES, where), dtype=np.uint8)
        measured = np.unpackbits(bits, bitorder="little")[: int(points)]
        if measured.size < points:
            raise unusable(where, printable(valid, 60), f"{measured.size} bits", f">= {points:g} bits")
    values = np.frombuffer(content, dtype=kind).tolist()
    for place, (value, good) in enumerate(zip(values, measured.tolist(), strict=True), start=1):
        yield f"{where}: {printable(link, 60)} {place}", repr(value) if good else "BAD"


X3P = TraceFormat(
    name="X3P", standard="ISO 25178-72", begins=lambda content: content.startswith(_BEGINNING), read=read_x3p
)
