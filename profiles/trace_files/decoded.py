"""The bytes of a trace file as text, whatever program wrote it.

UTF-8 with or without a byte order mark, or UTF-16 with one, as spreadsheets save "Unicode text". Lines end with
LF, CR LF or CR.

Problem codes: `trace.not_utf8`, `trace.empty`.
"""

from __future__ import annotations

import codecs

from profiles.problem import refused

_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def decoded(content: bytes, where: str) -> str:
    """Return the text with LF at the end of each line.

    Raises `ProfileError`: `trace.not_utf8` with its line, or `trace.empty`.
    """
    encoding = "utf-16" if content.startswith(_UTF_16) else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        value = f"0x{content[error.start]:02x}"
        raise refused("trace.not_utf8", where=f"{where}:{line}", value=value) from error
    if not text.strip():
        raise refused("trace.empty", where=where)
    return text.replace("\r\n", "\n").replace("\r", "\n")
