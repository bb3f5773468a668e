"""What a scanned code means: `job:NAME` names a job, and anything else nothing."""

from __future__ import annotations

from collections.abc import Sequence

from profiles.files import printable
from profiles.problem import Problem
from profiles.store import LibraryEntry

PREFIX = "job:"
LONGEST = 40  # characters of a code that are shown

# The two-set Hangul layout: what its keys write in place of the Latin characters.
_JAMO = "ㅂㅈㄷㄱㅅㅛㅕㅑㅐㅔㅁㄴㅇㄹㅎㅗㅓㅏㅣㅋㅌㅊㅍㅠㅜㅡㅃㅉㄸㄲㅆㅒㅖ"
_KEYS = "qwertyuiopasdfghjklzxcvbnmQWERTOP"
_PAIRS = "ㅘhk ㅙho ㅚhl ㅝnj ㅞnp ㅟnl ㅢml ㄳrt ㄵsw ㄶsg ㄺfr ㄻfa ㄼfq ㄽft ㄾfx ㄿfv ㅀfg ㅄqt"
_LEADS = "ㄱㄲㄴㄷㄸㄹㅁㅂㅃㅅㅆㅇㅈㅉㅊㅋㅌㅍㅎ"
_VOWELS = "ㅏㅐㅑㅒㅓㅔㅕㅖㅗㅘㅙㅚㅛㅜㅝㅞㅟㅠㅡㅢㅣ"
_TAILS = "\0ㄱㄲㄳㄴㄵㄶㄷㄹㄺㄻㄼㄽㄾㄿㅀㅁㅂㅄㅅㅆㅇㅈㅊㅋㅌㅍㅎ"
_FIRST, _LAST = 0xAC00, 0xD7A3

_KEY_OF = {**dict(zip(_JAMO, _KEYS, strict=True)), **{pair[0]: pair[1:] for pair in _PAIRS.split()}, "\0": ""}


def keys_of(text: str) -> str:
    """Return the Latin characters on the keys that have written a text; other characters stay as they are."""
    return "".join(_keys_of_one(character) for character in text)


def _keys_of_one(character: str) -> str:
    place = ord(character)
    if not _FIRST <= place <= _LAST:
        return _KEY_OF.get(character, character)
    syllable, tail = divmod(place - _FIRST, len(_TAILS))
    lead, vowel = divmod(syllable, len(_VOWELS))
    return _KEY_OF[_LEADS[lead]] + _KEY_OF[_VOWELS[vowel]] + _KEY_OF[_TAILS[tail]]


def job_named(text: str) -> str | None:
    """Return the name in the code of a job, also where the Hangul layout was on; None for any other code.

    A Caps Lock changes nothing: names are compared without case.
    """
    for read in (text, keys_of(text)):
        if read.casefold().startswith(PREFIX) and (name := read[len(PREFIX) :].strip()):
            return name
    return None


def found(entries: Sequence[LibraryEntry], name: str) -> LibraryEntry | Problem:
    """Return the job of this name, or why there is none: written in exactly this way, else in whatever case."""
    exact = [entry for entry in entries if entry.name == name]
    if exact:
        return exact[0]
    names = {name.casefold(), keys_of(name).casefold()}  # the prefix may be written in Latin, and the name not
    alike = [entry for entry in entries if entry.name.casefold() in names]
    if len(alike) == 1:
        return alike[0]
    return Problem(code="screen.scanned_several" if alike else "screen.scanned_no_job", value=shown(name))


def shown(text: str) -> str:
    """Return a code as it is shown: what could control a terminal is escaped, what is long shortened."""
    safe = printable(text)
    return safe if len(safe) <= LONGEST else f"{safe[: LONGEST - 1]}…"
