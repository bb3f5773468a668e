"""Note and tags of a job: words for people, which no cut depends on.

They are lines of the job's file, and no part of its hash: what was learned of a job, and its records, are found by
that hash, and a note must not take them away.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence

LABELS = ("note", "tags")

_TEXT = rb'"(?:[^"\\\r\n]|\\[^\r\n])*"'
# A label in a line of its own, as this package writes it. In a sound job such a line is nothing else: no text of a
# job has a line break. A label that is spelled otherwise counts as content.
_LINE = re.compile(
    rb"^(\xef\xbb\xbf)?[ \t]*(?:note[ \t]*=[ \t]*"
    + _TEXT
    + rb"|tags[ \t]*=[ \t]*\[(?:[ \t]*"
    + _TEXT
    + rb"[ \t]*,?)*[ \t]*\])[ \t]*(?:\r?\n|\Z)",
    re.MULTILINE,
)
_MARK = b"\xef\xbb\xbf"


def hash_of_job(content: bytes) -> str:
    """Return the sha256, hexadecimal, of a job file without its labels: of the bytes, where it has none."""
    return hashlib.sha256(without_labels(content)).hexdigest()


def without_labels(content: bytes) -> bytes:
    """Return the bytes of a job file without the lines of its labels."""
    return _LINE.sub(rb"\1", content)


def with_labels(content: bytes, note: str, tags: Sequence[str]) -> bytes:
    """Return the bytes of a job file with these labels as its first lines; all other bytes stay."""
    plain = without_labels(content)
    mark = _MARK if plain.startswith(_MARK) else b""
    lines = [f"note = {_spelled(note)}\n"] if note else []
    lines += [f"tags = [{', '.join(map(_spelled, tags))}]\n"] if tags else []
    return mark + "".join(lines).encode() + plain.removeprefix(mark)


def _spelled(text: str) -> str:
    """Return a text of printable characters as TOML writes it, which is as JSON does."""
    import json  # not for the first page

    return json.dumps(text, ensure_ascii=False)
