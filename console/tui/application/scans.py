"""What the screens do about keys that came too fast for a person, and about the code that they were.

`job:NAME` names a job, and any other code nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from console.tui.gate import PASTED
from console.tui.pace import Scan
from console.tui.page import Page
from console.tui.ui_context import UiContext
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


def find_job(entries: Sequence[LibraryEntry], name: str) -> LibraryEntry | Problem:
    """Return the job of this name, or why there is none: written in exactly this way, else in whatever case."""
    exact = [entry for entry in entries if entry.name == name]
    if exact:
        return exact[0]
    names = {name.casefold(), keys_of(name).casefold()}  # the prefix may be written in Latin, and the name not
    alike = [entry for entry in entries if entry.name.casefold() in names]
    if len(alike) == 1:
        return alike[0]
    return Problem(code="screen.scanned_several" if alike else "screen.scanned_no_job", value=printable_code(name))


def printable_code(text: str) -> str:
    """Return a code as it is shown: what could control a terminal is escaped, what is long shortened."""
    safe = printable(text)
    return safe if len(safe) <= LONGEST else f"{safe[: LONGEST - 1]}…"


class Scans:
    """Answers to bursts of keys, and to pasted text. `jobs` returns the page that opens a job, or refuses."""

    def __init__(self, ui: UiContext, jobs: Callable[[], Page]) -> None:
        self._ui, self._jobs = ui, jobs

    def refuse_paste(self, *, moving: bool) -> None:
        """Say that pasted text does nothing outside an entry; it was not typed, and stops any motion."""
        self._ui.say_until_key(Problem(code="screen.pasted_stopped" if moving else "screen.pasted"))
        if moving:
            self._ui.stop(PASTED)

    def too_fast(self, *, written: bool, stopped: bool) -> None:
        """Say that keys were not taken, while it is not known yet what they are.

        A stop among keys that wrote into an entry has closed it: what the stop did is the answer to all of them.
        """
        if written and stopped:
            return
        code = "screen.too_fast_stopped" if stopped else "screen.too_fast"
        self._ui.say_until_key(Problem(code="screen.too_fast_entry" if written else code))

    def take(self, scan: Scan, *, small: bool) -> None:
        """Open the job of a code; say what any other code is, and that nothing was done."""
        name = job_named(scan.text)
        if scan.written:  # it stands in the entry, and is nobody's business elsewhere
            self.too_fast(written=True, stopped=scan.stopped)
        elif scan.stopped or small or name is None:
            code = "screen.scanned_stopped" if scan.stopped else "screen.scanned"
            self._ui.say_until_key(Problem(code=code, value=printable_code(scan.text)))
        else:
            self._ui.key_answer = ()
            self._jobs().open_named(name)
