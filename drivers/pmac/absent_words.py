"""Words of the manuals that neither the simulated controller nor the check of programs has."""

from __future__ import annotations

import re

_ABSENT = (
    ("LEARN", "LEARN"),
    ("PRELUDE", "PRELUDE"),
    ("DISPLAY", r".*DISP(LAY)?[\d,.]*[IPQM]\d"),
    ("CC0 to CC3", r"CC[0-3]"),
    ("CCR", "CCR"),
    ("TSELECT", r"TSEL(ECT)?"),
    ("TINIT", "TINIT"),
    ("ADIS, AROT, IDIS, IROT", r"(A|I)(DIS|ROT)"),
    ("altered destination (!)", r"[A-CU-Z]*!"),
    ("rotary buffers (ROT)", r"((OPEN|DEF(INE)?|DEL(ETE)?)(BIN)?|)ROT(ARY)?(\d|$)"),
    ("compiled PLCs (PLCC)", r".*PLCC\d"),
    ("DEFINE of TBUF, TCOMP, BLCOMP, TRACE", r"DEF(INE)?(TBUF|TCOMP|BLCOMP|TRACE)"),
    ("LOCK, UNLOCK", r"(UN)?LOCK[\dP]"),
    ("SETPHASE", "SETPHASE"),
    ("further words of the MACRO ring", r"STN|MACRO(SLV|STASCII|MST|AUX|ASCII)|MS(\$\$\$|SAV)|MFLUSH"),
    ("TIME, TODAY, UPDATE", r"TIME=?|TODAY|UPDATE"),
    ("LIST LINK", "LISTLINK"),
)
_FOUND = re.compile(r", found (.+)$")


def absent_word(text: str, detail: str) -> str:
    """Return the word because of which a line was refused, "" where it is none of those.

    `detail` is the reason of the refusal: it ends with what was found where a word was expected.
    """
    found = _FOUND.search(detail)
    for part in (found[1] if found else "", text):
        typed = "".join(part.split()).upper()
        for name, pattern in _ABSENT:
            if re.match(pattern, typed):
                return name
    return ""
