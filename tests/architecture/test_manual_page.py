"""The manual page is that of the commands, and man reads it; shells read their completion."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from console.cli.commands import COMMANDS
from console.cli.site.completion import NAMES, SHELLS, completion_of
from docs.manual_page import PAGE, manual_page
from docs.site import PARTS, broken_links, fetched_from_elsewhere, staged

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="argparse of another Python breaks lines otherwise")
def test_the_manual_page_is_that_of_the_commands() -> None:
    if os.environ.get("GOLDENS") == "write":
        PAGE.write_text(manual_page(), encoding="utf-8")
    assert PAGE.read_text(encoding="utf-8") == manual_page(), "write it anew: python -m docs.manual_page"


def test_the_manual_page_has_every_command_and_is_in_the_wheel() -> None:
    text = PAGE.read_text(encoding="utf-8").replace("\\-", "-")
    assert [name for name in COMMANDS if f"console {name}" not in text] == []
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    shared = project["tool"]["hatch"]["build"]["targets"]["wheel"]["shared-data"]
    assert {source: shared[source] for source in shared if source.startswith("docs/man/")} == {
        f"docs/man/{name}.1": f"share/man/man1/{name}.1" for name in NAMES
    }


@pytest.mark.skipif(shutil.which("man") is None, reason="man is not installed (Debian and Ubuntu: man-db)")
def test_man_shows_it_without_a_warning() -> None:
    command = ["man", "--warnings", "--encoding=ascii", "-l", str(PAGE)]
    shown = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, "MANWIDTH": "80"}, check=True
    )
    assert shown.stderr == ""
    assert "--fail-out-of-tolerance" in shown.stdout and "EXIT STATUS" in shown.stdout


def completed(line: str, *, name: str = "console") -> list[str]:
    """What bash offers at the end of a line."""
    words = line.split(" ")
    quoted = " ".join(f"'{word}'" for word in words)
    asked = (
        f"COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; _shtab_{name}; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    )
    script = f"{completion_of('bash', name)}\n{asked}"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout.split()


def test_bash_completes_commands_actions_and_options() -> None:
    assert completed("console mt") == ["mtconnect"]
    assert completed("console records ex") == ["export"]
    assert completed("console run --fail") == ["--fail-out-of-tolerance"]
    assert completed("console run --strategy t") == ["timebase"]
    assert completed("trilobe wa", name="trilobe") == ["watch"]


@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_reads_its_completion(shell: str) -> None:
    script = completion_of(shell, "console")
    assert [name for name in COMMANDS if name not in script] == []
    program = shutil.which(shell)
    if program is None:
        pytest.skip(f"{shell} is not installed")
    subprocess.run([program, "-n"], input=script, text=True, check=True, capture_output=True)


def test_no_other_command_pays_for_completion() -> None:
    script = "import sys, console.__main__ as m; m.main(['jobs']); assert 'shtab' not in sys.modules"
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)


# The site stands by itself: what would be loaded from elsewhere, and links that lead nowhere, are found.


WHOLE = '<h1 id="top">T</h1><a href="b.html#there">b</a><a href="https://example.org">e</a><img src="p.svg">'
OTHER = '<h2 id="there">B</h2><a href="a.html">a</a><link rel="canonical" href="https://example.org/b">'


def site(folder: Path, **files: str) -> Path:
    for name, text in {"a.html": WHOLE, "b.html": OTHER, **files}.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def test_a_site_that_stands_by_itself_is_taken(tmp_path: Path) -> None:
    site(tmp_path, **{"s.css": "p{background:url(p.svg)}", "p.svg": '<svg xmlns="http://www.w3.org/2000/svg"/>'})
    assert [*fetched_from_elsewhere(tmp_path), *broken_links(tmp_path)] == []


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("c.html", '<script src="https://cdn.example/x.js"></script>'),
        ("c.html", '<script src="//cdn.example/x.js"></script>'),
        ("c.html", '<link rel="stylesheet" href="http://fonts.example/css">'),
        ("c.html", '<link rel="preconnect" href="https://fonts.example">'),
        ("c.html", '<img src="https://example.org/badge.svg">'),
        ("c.html", '<p style="background: url(https://example.org/p.png)">'),
        ("c.html", "<style>@import 'https://example.org/s.css'</style>"),
        ("c.css", '@font-face { src: url("https://fonts.example/f.woff2") }'),
        ("c.svg", '<svg xmlns="http://www.w3.org/2000/svg"><image href="https://example.org/p.png"/></svg>'),
    ],
)
def test_what_would_be_loaded_from_elsewhere_is_found(name: str, text: str, tmp_path: Path) -> None:
    (found,) = fetched_from_elsewhere(site(tmp_path, **{name: text}))
    assert found.startswith(f"{name} loads ")


@pytest.mark.parametrize("link", ["c.html", "b.html#here", "#nowhere"])
def test_a_link_that_leads_nowhere_is_found(link: str, tmp_path: Path) -> None:
    (found,) = broken_links(site(tmp_path, **{"a.html": f'<a href="{link}">x</a>'}))
    assert found == f"a.html links to {link}"


def test_every_document_is_in_the_list_of_pages_once(tmp_path: Path) -> None:
    staged(tmp_path)
    lines = (tmp_path / "index.md").read_text(encoding="utf-8").splitlines()
    pages = {f"docs/{path.stem}" for path in (ROOT / "docs").glob("*.md")}
    assert {page: lines.count(page) for page in pages if lines.count(page) != 1} == {}
    assert {
        page for pages in PARTS.values() for page in pages if not (ROOT / "docs" / f"{page}.md").exists()
    } == set()
