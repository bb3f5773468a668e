"""Problems as sentences: the console says them in the language of its operator, errors in English."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Protocol

LANGUAGES = {"en": "English", "ko": "Korean"}
"""The languages of the console, with their English names: for a terminal that cannot show their own."""

NAMES_A_KEY = ("key.", "value.", "schema.", "safety.not_signed", "safety.unknown", "safety.nobody_named")
"""Problems, by the beginning of their code, whose key is that of a file: it is written as in the file."""


class _Facts(Protocol):
    """A problem, which reads its words here."""

    @property
    def code(self) -> str: ...
    @property
    def where(self) -> str: ...
    @property
    def key(self) -> str: ...
    @property
    def value(self) -> str: ...
    @property
    def limit(self) -> str: ...
    @property
    def facts(self) -> str: ...


_LINES = re.compile(r'^"([^"\\\n]+)" = "([^"\\\n]*(?:\\["\\n][^"\\\n]*)*)"$|^([^#\n].*)', re.MULTILINE)
"""Key and text of a plain entry, or a line that is none, without empty lines and comments."""

_ESCAPES = {r"\"": '"', r"\\": "\\", r"\n": "\n"}  # in the text of a plain entry
_ESCAPE = re.compile(r'\\["\\n]')

SINGULAR = ".one"  # ends the key of a singular, beside that of its plural; a language without singulars has none


class Sentences:
    """The words of one language. A key that is missing shows itself: better an ugly line than none."""

    def __init__(self, entries: Mapping[str, str]) -> None:
        self._entries = entries
        self._always: Mapping[str, str] = {}  # what placeholders of every entry stand for, such as a unit

    def __call__(self, key: str, /, **fields: object) -> str:
        """Return the sentence of `key` with its fields filled in, in the singular if its field `count` is 1."""
        entry = self._entries.get(key + SINGULAR) if fields.get("count") == 1 else None
        entry = entry or self._entries.get(key)
        if entry is None:
            return " ".join([key, *(f"{name}={value}" for name, value in fields.items())])
        return entry.format(**{**self._always, **fields})

    def first_sentence(self, key: str, other: str, /, **fields: object) -> str:
        """Return the sentence of `key`, that of the `other` where there is none."""
        return self(key if key in self._entries else other, **fields)

    def problem(self, problem: _Facts) -> str:
        """Return one line that names what, where, value, limit and remedy."""
        key = f"problem.{problem.code}.{problem.key}"
        if key not in self._entries:
            key = f"problem.{problem.code}"
        if key not in self._entries:
            return " ".join(problem.facts.split())
        # A field without bounds says nothing of what is allowed.
        unbounded = "any number" if problem.code.startswith(("key.", "value.")) else ""
        of_a_stop = problem.code == "machine.stopped"
        value = self.reason(problem.value) if of_a_stop else self.words(problem.value)
        name = problem.key if problem.code.startswith(NAMES_A_KEY) else self.words(problem.key)
        limit = self.words(problem.limit or unbounded)
        sentence = self(key, key=name, value=value, limit=limit, where=problem.where)
        shown = f"{problem.where}: {sentence}" if problem.where and problem.where not in sentence else sentence
        # A fact that is missing at the end of a parenthesis leaves no gap.
        return self._format_sentence(" ".join(shown.split()).replace(" )", ")"))

    def _format_sentence(self, sentence: str) -> str:
        """Return the sentence of a problem as it is shown; a subclass may show more of its values."""
        return sentence

    def reason(self, reason: str) -> str:
        """Return for what the machine was stopped: a key, a fault, a motion that did not end, a signal.

        The code of a problem says that its alarm tells more.
        """
        kind, _, key = reason.partition(" ")
        if key and f"stop_reason.{kind}_key" in self._entries:
            return self(f"stop_reason.{kind}_key", key=key)
        said = self._entries.get(f"stop_reason.{reason}")
        if said is None and f"problem.{reason}" in self._entries:
            said = self._entries["stop_reason.alarm"]
        return said or self.words(reason)

    def words(self, fact: str) -> str:
        """Return the wording of a fact in this language, such as "not a regular file"; else the fact.

        Of facts with commas between each is worded, and of "tool: amplifier_fault" both sides of the colon.
        """
        whole = self._entries.get(f"word.{fact}")
        if whole is not None:
            return whole
        return ", ".join(self._pair(each) for each in fact.split(", "))

    def _pair(self, fact: str) -> str:
        head, colon, tail = fact.partition(": ")
        if f"word.{head}" not in self._entries:
            return fact
        return self._entries[f"word.{head}"] + colon + self._entries.get(f"word.{tail}", tail)


def words_of(language: str) -> Mapping[str, str]:
    """Return the words of a language in `LANGUAGES` of every package that is imported, each key in one file."""
    return _words_in(language, word_folders())


def word_folders() -> tuple[Path, ...]:
    """Return the folders of words of the packages that are imported; each names its own in `WORDS`.

    So the sentence of a problem is in the package that raises it, and this one knows none above it.
    """
    return _folders_of(len(sys.modules))


@lru_cache(maxsize=1)
def _folders_of(_modules: int) -> tuple[Path, ...]:
    """Return those folders while as many modules are imported: to go through them takes a millisecond."""
    packages = [module for name, module in list(sys.modules.items()) if "." not in name]
    homes = [(path, package) for package in packages for path in getattr(package, "__path__", ())]
    return tuple(Path(path, folder) for path, package in homes for folder in vars(package).get("WORDS", ()))


@cache
def _words_in(language: str, folders: tuple[Path, ...]) -> Mapping[str, str]:
    return {key: entry for folder in folders for key, entry in entries_in(folder / language).items()}


def entries_in(folder: Path) -> dict[str, str]:
    """Return all entries of the catalogues in a folder."""
    entries: dict[str, str] = {}
    for path in sorted(folder.glob("*.toml")):
        entries |= entries_of(path.read_text(encoding="utf-8"))
    return entries


def entries_of(text: str) -> dict[str, str]:
    """Return the entries of a catalogue: TOML, but a tenth of the time where each is a plain text on its line.

    The first picture waits for some thousand of them.
    """
    found = _LINES.findall(text)
    entries: dict[str, str] = {key: sentence for key, sentence, _ in found if key}
    for key in [key for key, sentence in entries.items() if "\\" in sentence]:
        entries[key] = _ESCAPE.sub(lambda escape: _ESCAPES[escape[0]], entries[key])
    others = [line for _, _, line in found if line]
    if any('"""' in line or not line.startswith('"') for line in others):
        return _toml(text)
    if others:  # with another escape, or a comment behind it
        entries |= _toml("\n".join(others))
    return entries


def _toml(text: str) -> dict[str, Any]:
    """Read a TOML text, with what no start of a command has to wait for."""
    import tomllib

    return tomllib.loads(text)


def english() -> Sentences:
    """Return the words in which errors speak by themselves."""
    return Sentences(words_of("en"))
