"""The keys of a keyboard with the Hangul layout (two-set), which writes jamo of what a scanner types."""

from __future__ import annotations

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
