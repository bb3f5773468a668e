"""Text catalogues: every sentence by its key, in the operator's language."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import drivers  # noqa: F401  # its words
from console.units import METRIC, Units
from profiles.words.sentences import LANGUAGES, Sentences, words_of

__all__ = ["LANGUAGES", "Catalogue", "LiveCatalogue", "choose_language", "load", "words_of"]


class Catalogue(Sentences):
    """One language: the sentences of the console, and the problem texts of the profiles.

    `units` are those in which lengths are shown: millimetres, unless a screen was set to inches.
    """

    def __init__(self, language: str, entries: Mapping[str, str]) -> None:
        super().__init__(entries)
        self.language = language
        self._measure_in(METRIC)

    def _format_sentence(self, sentence: str) -> str:
        return self.units.add_inches(sentence)

    def _measure_in(self, units: Units) -> None:
        self.units, self._always = units, units.names


class LiveCatalogue(Catalogue):
    """Texts that can go on in another language or in other units, for whatever holds them."""

    def __init__(self, language: str) -> None:
        super().__init__(language, words_of(language))

    def speak(self, language: str) -> None:
        """Go on in another language of `LANGUAGES`."""
        self._entries, self.language = words_of(language), language

    def measure(self, units: str) -> None:
        """Go on in other units of `UNITS`."""
        self._measure_in(Units(units))


@cache
def load(language: str) -> Catalogue:
    """Read the catalogue of a language in `LANGUAGES`."""
    return Catalogue(language, words_of(language))


def choose_language(
    arguments: Sequence[str], environment: Mapping[str, str], configured: str | None = None
) -> str:
    """Return the language given with `--lang`, else the configured one, that of the environment, or English."""
    for place, argument in enumerate(arguments):
        if argument == "--lang" and place + 1 < len(arguments) and arguments[place + 1] in LANGUAGES:
            return arguments[place + 1]
        if argument.startswith("--lang=") and argument[7:] in LANGUAGES:
            return argument[7:]
    variable = language_variable(environment)
    if configured is not None or not variable:
        return configured or "en"
    return next((each for each in LANGUAGES if environment[variable].startswith(each)), "en")


def language_variable(environment: Mapping[str, str]) -> str:
    """Return the variable that states the language of this account, "" for none."""
    return next((name for name in ("LC_ALL", "LC_MESSAGES", "LANG") if environment.get(name)), "")
