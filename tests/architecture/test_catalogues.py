"""Both languages say the same things, and nothing that can go wrong is without words."""

import ast
import re
import string
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import console
import drivers
import profiles
from console.tui.keymap import ACTIONS
from console.units import METRIC
from profiles.words.sentences import LANGUAGES, SINGULAR, entries_of, word_folders

ROOT = Path(__file__).parents[2]
PACKAGES = tuple(package.__name__ for package in (console, drivers, profiles))

CODE = re.compile(
    r"(file|key|value|schema|job|machine|rule|trace|link|controller|cut|program|response|session|record"
    r"|alignment|stop|simulator|screen|flight)"
    r"\.[a-z0-9_]+"
)
QUOTED = re.compile(r"`([a-z]+\.[a-z0-9_]+)`")
NO_CODES = {
    "controller.variables",
    "controller.axis_definitions",
    "simulator.ready",
    "key.help",
    *(action.id for action in ACTIONS),
}
"""Looks like a code and is a table of the machine profile, a sentence of its own, or the action of a key."""

PROBLEM_FIELDS = {"where", "key", "value", "limit"}
HIGHEST_CONTROLLER_ERROR = 19
COMPOSED = (
    *(
        f"{area}.{what}"
        for area in ("file", "trace", "calibration", "clamping")
        for what in ("unreadable", "too_large")
    ),
    *(f"controller.err{number:03d}" for number in range(HIGHEST_CONTROLLER_ERROR + 1)),
)
"""Codes that no source has in one piece."""


def catalogues(language: str) -> list[Path]:
    """The files of a language, of all packages and rings."""
    return sorted(path for folder in word_folders() for path in (folder / language).glob("*.toml"))


@cache
def catalogue(language: str) -> dict[str, object]:
    """All entries of a language; a key that stands in two files would hide one of the sentences."""
    entries: dict[str, object] = {}
    for path in catalogues(language):
        fresh = tomllib.loads(path.read_text(encoding="utf-8"))
        assert not entries.keys() & fresh.keys(), path
        entries |= fresh
    return entries


def test_a_catalogue_is_read_as_the_toml_that_it_is() -> None:
    """Each of ours, and what none of them has so far: it is read line by line, which no other reader does."""
    ours = [path.read_text(encoding="utf-8") for language in LANGUAGES for path in catalogues(language)]
    for text in (
        *ours,
        '"a.b" = "\\"c\\" \\u00b5"  # said so\n\n# no more\n',
        "\"a\" = 'single'\n",
        '"a" = """\ntwo\nlines"""\n"b" = "c"\n',
        'a = "bare"\n[table]\n"b" = "c"\n',
        '"a"="no blanks"\n',
    ):
        assert entries_of(text) == tomllib.loads(text)


def plain_keys(language: str) -> set[str]:
    """The keys of a language without its singulars, which Korean does not have."""
    return {key for key in catalogue(language) if not key.endswith(SINGULAR)}


def problems_of(language: str) -> set[str]:
    """The codes of the problems that a language has a sentence for."""
    return {key.removeprefix("problem.") for key in catalogue(language) if key.startswith("problem.")}


def sources(having: str) -> Iterator[tuple[Path, ast.Module]]:
    """Yield the sources in which a pattern is found, parsed."""
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        if re.search(having, source):
            yield path, ast.parse(source)


def placeholders(entry: str) -> list[tuple[str, str | None]]:
    """The fields of an entry with their formats, in an order that does not depend on the language."""
    return sorted((field, form) for _, field, form, _ in string.Formatter().parse(entry) if field is not None)


def codes_of(tree: ast.Module) -> set[str]:
    """Codes that stand in the source as a text of their own, or in a docstring in backquotes."""
    nodes = list(ast.walk(tree))
    parts = {part for node in nodes if isinstance(node, ast.JoinedStr) for part in node.values}
    found: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in parts:
            named = QUOTED.findall(node.value)
            found |= {text for text in (node.value, *named) if CODE.fullmatch(text)}
    return found - NO_CODES


def sentences_of(tree: ast.Module) -> Iterator[tuple[str, set[str], bool]]:
    """Calls `text("key", field=...)`: the key, the fields, and whether there may be more of them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and node.args:
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            first = node.args[0]
            if name == "text" and isinstance(first, ast.Constant) and isinstance(first.value, str):
                given = [keyword.arg for keyword in node.keywords]
                yield first.value, {field for field in given if field}, None in given


@pytest.mark.parametrize("language", LANGUAGES)
def test_entries_are_plain_sentences(language: str) -> None:
    entries = catalogue(language)
    assert entries
    assert [key for key, entry in entries.items() if not isinstance(entry, str) or not entry.strip()] == []


def test_both_languages_have_the_same_keys() -> None:
    english, korean = (set(plain_keys(language)) for language in LANGUAGES)
    assert (sorted(english - korean), sorted(korean - english)) == ([], [])


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_singular_has_its_plural_with_a_count_and_asks_for_nothing_else(language: str) -> None:
    entries = catalogue(language)
    for key in entries.keys() - plain_keys(language):
        plural = placeholders(str(entries.get(key.removesuffix(SINGULAR), "")))
        assert ("count", "") in plural, key
        assert set(placeholders(str(entries[key]))) <= set(plural), key


def test_both_languages_use_the_same_placeholders() -> None:
    english, korean = (catalogue(language) for language in LANGUAGES)
    shared = english.keys() & korean.keys()
    differing = [key for key in shared if placeholders(str(english[key])) != placeholders(str(korean[key]))]
    assert sorted(differing) == []


def given_codes() -> Iterator[tuple[str, str]]:
    """Yield whatever stands as the code of a problem in the source: the file with its line, and the code.

    Of a code that is put together there, its parts with a star for what comes in.
    """
    for path, tree in sources(r"\b(Problem|refusal_error)\("):
        for node in ast.walk(tree):
            name = getattr(node.func, "id", "") if isinstance(node, ast.Call) else ""
            if isinstance(node, ast.Call) and name in ("Problem", "refusal_error"):
                codes = [keyword.value for keyword in node.keywords if keyword.arg == "code"]
                for given in node.args[:1] if name == "refusal_error" else codes:
                    parts = given.values if isinstance(given, ast.JoinedStr) else [given]
                    code = "".join(str(part.value) if isinstance(part, ast.Constant) else "*" for part in parts)
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", code


WITHIN = {
    "profiles": ("profiles/words",),
    "drivers": ("profiles/words", "drivers/words"),
    "console": ("profiles/words", "drivers/words", "console/text"),
    "console/school": ("profiles/words", "drivers/words", "console/text", "console/school/words"),
    "console/site": ("profiles/words", "drivers/words", "console/text", "console/site/words"),
}
"""Of each package, and of each ring of the console, the folders whose words it has: its own, and those below."""

WORDING = "profiles/words/sentences.py"
"""Raises nothing: it asks for the code of a stop, whose value it puts into words."""


def owner_of(path: str) -> str:
    """The package or ring of a file; the more exact one of two."""
    return max((each for each in WITHIN if path.startswith(f"{each}/")), key=len)


@cache
def homes(language: str) -> dict[str, str]:
    """The folder of words of each key."""
    folders = {path: path.parents[1].relative_to(ROOT) for path in catalogues(language)}
    return {key: str(at) for path, at in folders.items() for key in entries_of(path.read_text(encoding="utf-8"))}


@cache
def texts_of_sources() -> dict[str, str]:
    """The text of each source by its place in the tree."""
    paths = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in paths}


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_catalogue_has_its_file_name_alone(language: str) -> None:
    names = [path.name for path in catalogues(language)]
    assert sorted(set(names)) == sorted(names)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_sentence_is_within_reach_of_what_raises_it(language: str) -> None:
    """In a notebook without a console; in a console whose school or site was taken away."""
    of, missed = homes(language), []
    quoted = {where: set(re.findall(r'"([a-z_.0-9]+)"', source)) for where, source in texts_of_sources().items()}
    quoted["profiles/files.py"] |= {code for code in COMPOSED if code.endswith((".unreadable", ".too_large"))}
    for where, codes in quoted.items():
        found = [code for code in codes if f"problem.{code}" in of and where != WORDING]
        missed += [(where, code) for code in found if of[f"problem.{code}"] not in WITHIN[owner_of(where)]]
    assert sum(map(len, quoted.values())) > len(problems_of(language))
    assert missed == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_package_has_no_sentence_that_only_those_above_it_raise(language: str) -> None:
    sources_of: dict[str, str] = dict.fromkeys(WITHIN, "")
    for where, source in texts_of_sources().items():
        sources_of[owner_of(where)] += source
    for key, folder in homes(language).items():
        code, owner = key.removeprefix("problem."), str(Path(folder).parent)
        if key.startswith("problem.") and owner != "console" and code not in COMPOSED:
            parents = (code, code.rpartition(".")[0])  # of a sentence for one key, the code alone
            assert any(f'"{each}"' in sources_of[owner] for each in parents), key


def test_no_problem_is_shown_as_its_bare_code() -> None:
    given, told = tuple(given_codes()), {language: problems_of(language) for language in LANGUAGES}
    plain = [(where, code) for where, code in given if "*" not in code]
    assert [(where, each) for each in LANGUAGES for where, code in plain if code not in told[each]] == []
    composed = {code for _, code in given if "*" in code and code != "*"}
    assert composed == {"*.unreadable", "*.too_large", "controller.err*"}
    assert [(code, each) for each in LANGUAGES for code in COMPOSED if code not in told[each]] == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_whatever_forbids_to_arm_by_the_stop_record_has_words_for_doctor_too(language: str) -> None:
    source = (ROOT / "drivers" / "commissioning" / "stop_record.py").read_text(encoding="utf-8")
    codes = re.findall(r"\"stops\.(\w+)\"", source)
    assert len(codes) > 4
    missing = [f"check.stops_{code}" for code in codes if f"check.stops_{code}" not in catalogue(language)]
    assert missing == []


def test_every_problem_code_has_a_sentence() -> None:
    written = set().union(*(codes_of(tree) for _, tree in sources(CODE.pattern)))
    assert {"key.missing", "rule.grip_margin", "cut.stroke_lost", "link.refused", "file.unreadable"} <= written
    codes = written | {f"controller.err{number:03d}" for number in range(1, HIGHEST_CONTROLLER_ERROR + 1)}
    missing = [(language, code) for language in LANGUAGES for code in codes - problems_of(language)]
    assert sorted(missing) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_problem_sentences_ask_only_for_what_a_problem_has(language: str) -> None:
    asked = {
        key: {field for field, _ in placeholders(str(entry))}
        for key, entry in catalogue(language).items()
        if key.startswith("problem.")
    }
    assert {key: fields for key, fields in asked.items() if not fields <= PROBLEM_FIELDS} == {}


def test_every_sentence_that_the_console_says_is_there() -> None:
    faults = []
    for path, tree in sources(r"\btext\("):
        for key, given, open_ended in sentences_of(tree):
            for language in LANGUAGES:
                entries = catalogue(language)
                asked = {field for field, _ in placeholders(str(entries.get(key, "")))}
                if key not in entries or (not open_ended and not asked <= given | METRIC.names.keys()):
                    faults.append(f"{path.relative_to(ROOT)}: {key} with {sorted(given)} in {language}")
    assert faults == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_height_of_a_harmonic_of_a_part_is_peak_to_peak(language: str) -> None:
    """Everywhere alike: an amplitude in one place and its double in another are taken for two findings."""
    half = {"en": "amplitude", "ko": "진폭"}[language]
    families = tuple("run. roundness. records report. inspect_page. learn calibrate. fingerprint. cause.".split())
    families += tuple("debrief. certificate. predict.pp v_block. study.".split())
    said = {key: str(each) for key, each in catalogue(language).items() if key.startswith(families)}
    assert [key for key, each in said.items() if half in each.lower()] == []
    for key in ("run.harmonic", "roundness.pp", "report.pp_axis", "calibrate.column.pp", "fingerprint.pp"):
        assert "p-p" in said[key], key
