"""The site stands by itself: what would be loaded from elsewhere, and links that lead nowhere, are found."""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.site import PARTS, ROOT, broken_links, fetched_from_elsewhere, staged

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
