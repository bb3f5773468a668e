"""What the documents say is so: links lead somewhere, quoted programs are the generated ones."""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from console.__main__ import main
from console.cli.commands import COMMANDS as CONSOLE_COMMANDS
from console.tui.key_help import TERMS
from docs.word_pages import FOLDER, PAGES, filled, sentences, shown
from drivers.pmac.language.errors import PmacError
from drivers.pmac.program_text import read_program
from drivers.pmac.programs.paper import paper_program, spindle_start_counts
from drivers.pmac.programs.setup import cut_setup
from profiles.store import load_job, load_machine
from profiles.trace_files.closed_profile import TraceFormat
from profiles.traces import OF_BYTES, OF_TEXT
from profiles.words.sentences import LANGUAGES

ROOT = Path(__file__).parents[2]
DOCUMENTS = (
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "benchmarks/README.md",
    *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md")),
)
COMMANDS = (
    "python3 -m venv .venv && .venv/bin/pip install -q -e . && .venv/bin/console --sim",
    "python3 -m venv .venv && .venv/bin/pip install -q -e '.[test]' && .venv/bin/pytest",
)

MOST_LINES_OF_THE_README = 85

LINK = re.compile(r"\]\(([^)\s]+)\)")
SPAN = re.compile(r"`([^`]+)`")
SOURCE_FILE = re.compile(r"[\w/.-]*\w\.py")
TEXT_SUFFIXES = {".py", ".md", ".toml", ".lock", ".txt", ".cfg", ".ini", ".yml", ".yaml", ".sh"}
NOT_OURS = re.compile(r"\.(venv|git|hypothesis|.*_cache)|__pycache__|.*\.egg-info|dist|build")
# In pieces, so that this file does not contain what it forbids.
INDEX_HOSTS = re.compile("py" + r"pi\.org|python" + "hosted" + r"\.org|--(extra-)?index" + "-url", re.IGNORECASE)
HOME_FOLDERS = re.compile(r"(?<![\w.~}-])/(" + "home|Users" + r")/\w")


def text_of(document: str) -> str:
    return (ROOT / document).read_text(encoding="utf-8")


def fenced_after(document: str, heading: str) -> str:
    """The first fenced block under a heading."""
    section = text_of(document).split(f"\n{heading}\n", 1)[1]
    return re.split(r"^```\w*\n", section, maxsplit=2, flags=re.MULTILINE)[1]


def project_texts() -> Iterator[Path]:
    folders = [ROOT]
    while folders:
        for path in sorted(folders.pop().iterdir()):
            if NOT_OURS.fullmatch(path.name):
                continue
            if path.is_dir():
                folders.append(path)
            elif path.suffix in TEXT_SUFFIXES or path.parent.name == ".ci":
                yield path


def test_the_mended_program_is_the_one_that_is_printed_and_sent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    quoted = fenced_after("docs/paper-program.md", "## The mended program")
    words = ("program", "lee-2001-experiment-1", "--strategy", "paper", "--data", str(tmp_path))
    assert main(words) == 0
    assert quoted == capsys.readouterr().out
    job, machine = load_job("lee-2001-experiment-1").job, load_machine("lee-2001-lathe").machine
    setup = cut_setup(job, machine, spindle_start_counts(job, machine))
    assert quoted.partition("\n")[2] == paper_program(job, machine, setup)


def test_the_printed_program_is_a_program_but_for_its_wrapped_comments() -> None:
    printed = fenced_after("docs/paper-program.md", "## The printed program")
    wrapped = [line for line in printed.splitlines() if not line.partition(";")[0].isascii()]
    assert len(wrapped) == 2
    with pytest.raises(PmacError) as refused:
        read_program(printed)
    assert refused.value.code == 4
    kept = [line for line in printed.splitlines() if line not in wrapped]
    assert len(read_program("\n".join(kept)).program) == 9


@pytest.mark.parametrize("document", DOCUMENTS)
def test_relative_links_lead_to_a_file(document: str) -> None:
    targets = [target.partition("#")[0] for target in LINK.findall(text_of(document)) if "://" not in target]
    folder = (ROOT / document).parent
    assert [target for target in targets if target and not (folder / target).exists()] == []


def anchors_of(path: Path) -> set[str]:
    """The names by which the headings of a document are linked to: small letters, hyphens for blanks, no signs."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_to_a_heading_lead_to_one(document: str) -> None:
    here = ROOT / document
    links = (target.partition("#") for target in LINK.findall(text_of(document)) if "://" not in target)
    named = [(here.parent / name if name else here, anchor) for name, _, anchor in links if anchor]
    assert [(path.name, anchor) for path, anchor in named if anchor not in anchors_of(path)] == []


@pytest.mark.parametrize("document", DOCUMENTS)
def test_a_fence_that_is_opened_is_closed(document: str) -> None:
    fences = re.findall(r"^[ ]*(```.*)$", text_of(document), flags=re.MULTILINE)
    assert len(fences) % 2 == 0
    assert {fence for fence in fences[1::2] if fence != "```"} == set()


@pytest.mark.parametrize("document", DOCUMENTS)
def test_source_files_that_are_named_exist(document: str) -> None:
    named = [span for span in SPAN.findall(text_of(document)) if SOURCE_FILE.fullmatch(span)]
    assert [name for name in named if not any(path.endswith(f"/{name}") for path in source_files())] == []


@functools.cache
def source_files() -> list[str]:
    return [f"/{path.relative_to(ROOT)}" for path in project_texts() if path.suffix == ".py"]


def test_every_choice_of_the_emulation_is_where_it_is_said_to_be() -> None:
    code = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "drivers").rglob("*.py"))
    words = set(re.findall(r"\w+", code))  # nearly every name is one, and need not be searched for
    names = set()
    for row in text_of("docs/pmac-emulation.md").splitlines():
        certainty = row.rstrip("| ").rpartition("|")[2]
        if "choice: `" in certainty:
            names |= {span for span in SPAN.findall(certainty) if not SOURCE_FILE.fullmatch(span)}
    assert len(names) > 10
    assert sorted(name for name in names - words if not re.search(rf"\b{re.escape(name)}\b", code)) == []


@pytest.mark.parametrize("command", COMMANDS)
def test_the_readme_has_its_commands_on_lines_of_their_own(command: str) -> None:
    blocks = re.findall(r"^```\w*\n(.*?)^```", text_of("README.md"), flags=re.MULTILINE | re.DOTALL)
    assert [line for block in blocks for line in block.splitlines()].count(command) == 1


@pytest.mark.parametrize("command", CONSOLE_COMMANDS)
def test_the_page_of_commands_has_every_command(command: str) -> None:
    assert f"| `console {command}" in text_of("docs/commands.md")


def test_the_readme_is_read_in_a_few_minutes() -> None:
    assert len(text_of("README.md").splitlines()) <= MOST_LINES_OF_THE_README


@pytest.mark.parametrize("kind", (*OF_BYTES, *OF_TEXT), ids=lambda kind: str(kind.name))
def test_every_trace_format_that_is_read_is_in_the_documents(kind: TraceFormat[bytes] | TraceFormat[str]) -> None:
    assert f"| {kind.name} ({kind.standard}) |" in text_of("docs/traces.md")
    assert re.search(rf"console roundness .*\b{kind.name}\b", text_of("docs/commands.md"))


def test_no_text_names_a_machine_or_a_package_server() -> None:
    here = re.compile(rf"{re.escape(str(ROOT))}(?![\w-])" if len(ROOT.parts) > 2 else r"(?!)")
    found = []
    for path in project_texts():
        text = path.read_text(encoding="utf-8")
        if any(pattern.search(text) for pattern in (here, INDEX_HOSTS, HOME_FOLDERS)):
            found.append(str(path.relative_to(ROOT)))
    assert found == []


# Pages that quote the program have its words of today, and no sign in them is taken for Markdown.


WRITE_THEM = "written anew by: .venv/bin/python -m docs.word_pages"


def page(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


@pytest.mark.parametrize(("name", "language"), PAGES.items())
def test_a_page_has_the_words_of_today(name: str, language: str) -> None:
    is_today = filled(page(name), language) == page(name)
    assert is_today, WRITE_THEM


@pytest.mark.parametrize(("name", "language"), [("troubleshooting.md", "en"), ("troubleshooting.ko.md", "ko")])
def test_every_message_is_found_by_its_code(name: str, language: str) -> None:
    codes = [key.removeprefix("problem.") for key in sentences(language) if key.startswith("problem.")]
    found = re.findall(r"\| `([^`]+)` \|$", page(name), flags=re.MULTILINE)
    assert len(codes) > 500
    assert sorted(found) == sorted(codes)


def test_every_term_of_the_screens_is_in_the_glossary_in_both_languages() -> None:
    text = page("glossary.md")
    for language in LANGUAGES:
        words = sentences(language)
        terms = {term for terms in TERMS.values() for term in terms}
        assert {term for term in terms if f"| {shown(words[f'glossary.{term}'])} |" not in text} == set()


def test_what_a_message_leaves_open_is_an_ellipsis_and_its_signs_stay_signs() -> None:
    assert shown("{key} = {value} * 2 in P0..99 | <a> [b] {unit_mm}") == r"… = … \* 2 in P0..99 \| \<a\> \[b\] mm"


def test_a_group_that_no_block_names_is_in_the_block_without_names() -> None:
    text = "<!-- messages: link -->\n<!-- end -->\n\n<!-- messages: -->\nOF BEFORE\n<!-- end -->\n"
    first, _, rest = filled(text, "en").partition("<!-- end -->")
    assert "`link.refused`" in first and "`link.refused`" not in rest
    assert "`file.exists`" in rest and "OF BEFORE" not in rest


# Every rule of the operator has a row in its page, and every test that a row names exists.


PAGE = (ROOT / "docs" / "operator-rules.md").read_text(encoding="utf-8")
COUNTS = {"J": 14, "S": 7, "A": 10, "C": 8, "M": 9, "U": 5, "R": 6, "X": 4, "L": 4}
ROWS = re.findall(r"(?m)^\| ([A-Z]\d+) \| (.+?) \| (.+) \|$", PAGE)
NAMED = re.compile(r"`([\w/]+\.py)(?:::(\w+))?`")
WITHOUT = ("*not met*", "*not here*", "*in part*")


@cache
def defined_in(name: str) -> frozenset[str]:
    tree = ast.parse((ROOT / "tests" / name).read_text(encoding="utf-8"))
    return frozenset(
        each.name for each in ast.walk(tree) if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)
    )


def test_every_rule_has_one_row() -> None:
    rules = [f"{letter}{number}" for letter, count in COUNTS.items() for number in range(1, count + 1)]
    assert [rule for rule, _, _ in ROWS] == rules


def test_every_named_test_exists() -> None:
    missing = []
    for rule, _, named in ROWS:
        for name, test in NAMED.findall(named):
            if name.startswith("console/"):
                path = ROOT / "tests" / name
                if not test and not path.exists() and (ROOT / name).exists():
                    continue  # a module of the console
            if not (ROOT / "tests" / name).exists() or (test and test not in defined_in(name)):
                missing.append(f"{rule}: {name}::{test}")
    assert missing == []


def test_a_rule_without_a_test_says_why() -> None:
    silent = [
        rule
        for rule, _, named in ROWS
        if not any(test for _, test in NAMED.findall(named)) and not named.startswith(WITHOUT)
    ]
    assert silent == []
