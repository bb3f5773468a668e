"""Write the pages that quote the program's own words: its messages and its terms, in both languages.

python -m docs.word_pages

What is between `<!-- messages: link heartbeat -->`, or `<!-- terms -->`, and `<!-- end -->` is written anew from
the text catalogues; everything else of a page is written by hand. A block `<!-- messages: -->` has the messages
that no other block of its page names.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from console.text.catalogue import load, words_of
from console.tui.key_help import TERMS
from console.units import METRIC
from profiles.words.sentences import SINGULAR

FOLDER = Path(__file__).parent
PAGES = {"troubleshooting.md": "en", "troubleshooting.ko.md": "ko", "glossary.md": "en"}
BLOCK = re.compile(r"(?ms)^<!-- (messages:|terms)([a-z_ ]*) -->\n.*?^<!-- end -->$")
PROBLEM = "problem."
HEADS = {"en": ("message", "code"), "ko": ("메시지", "코드")}
LEFT_OPEN = re.compile(r"\{(\w+)[^}]*\}")
SPECIAL = re.compile(r"([\\`*_<>\[\]|])")
OPEN = "…"


def filled(page: str, language: str) -> str:
    """Return a page with its blocks as the catalogues have them today."""
    named = {group for kind, groups in BLOCK.findall(page) if kind == "messages:" for group in groups.split()}

    def block(found: re.Match[str]) -> str:
        kind, groups = found[1], found[2].split()
        rows = [*(_terms() if kind == "terms" else _messages(language, groups, named))]
        head = found[0].partition("\n")[0]
        return "\n".join((head, "", *rows, *([""] if rows else []), "<!-- end -->"))

    return BLOCK.sub(block, page)


def _messages(language: str, groups: Iterable[str], named: set[str]) -> Iterator[str]:
    """Yield a table of the messages of some groups; without any, of those that are named nowhere."""
    wanted, entries = set(groups), sentences(language)
    message, code = HEADS[language]
    groups_of = {key: key.split(".")[1] for key in sorted(entries) if key.startswith(PROBLEM)}
    keys = [key for key, group in groups_of.items() if group in wanted or not (wanted or group in named)]
    if keys:
        yield f"| {message} | {code} |"
        yield "|---|---|"
    yield from (f"| {shown(entries[key])} | `{key.removeprefix(PROBLEM)}` |" for key in keys)


def _terms() -> Iterator[str]:
    """Yield a table of the terms of all pages, in both languages, in the order of the English ones."""
    english, korean = load("en"), load("ko")
    yield "| term | what it is | 용어 | 뜻 |"
    yield "|---|---|---|---|"
    names = {name for terms in TERMS.values() for name in terms}
    for name in sorted(names, key=lambda name: (english(f"term.{name}").lower(), name)):
        cells = (text(f"{kind}.{name}") for text in (english, korean) for kind in ("term", "glossary"))
        first, second, third, fourth = (shown(cell) for cell in cells)
        yield f"| **{first}** | {second} | **{third}** | {fourth} |"


def sentences(language: str) -> Mapping[str, str]:
    """Return the sentences of a language by their keys, as they are written, without singulars."""
    return {key: sentence for key, sentence in words_of(language).items() if not key.endswith(SINGULAR)}


def shown(sentence: str) -> str:
    """Return a sentence as Markdown, with an ellipsis for what it leaves open."""
    in_units = LEFT_OPEN.sub(lambda found: METRIC.names.get(found[1], OPEN), sentence)
    return SPECIAL.sub(r"\\\1", " ".join(in_units.split()))


def main() -> None:
    """Write the pages anew."""
    for name, language in PAGES.items():
        path = FOLDER / name
        path.write_text(filled(path.read_text(encoding="utf-8"), language), encoding="utf-8")
        print(f"written: {name}")


if __name__ == "__main__":
    main()
