"""Build the site of the documentation, and check that it stands by itself.

python -m docs.site FOLDER

The documents are built as they stand beside each other, with Sphinx, which has to be installed (`trilobe[docs]`).
A warning is a failure: a link that leads nowhere, a heading that is not there, a page that no list names. So is
anything that a built page would load from another computer.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from html.parser import HTMLParser
from pathlib import Path

ROOT = Path(__file__).parents[1]
HERE = Path(__file__).parent
DOCUMENTS = ("CONTRIBUTING.md", "CHANGELOG.md", "LICENSE", "benchmarks/README.md")
PARTS: Mapping[str, Sequence[str]] = {
    "Begin": ("operator", "operator.ko", "trainee", "engineer", "integrator", "safety", "gallery"),
    "Look up": ("commands", "install", "troubleshooting", "troubleshooting.ko", "glossary", "operator-rules"),
    "The part": ("calibration", "strategies", "learning", "traces", "records", "report", "api"),
    "The machine": (
        "commissioning",
        "links",
        "heartbeat",
        "ownership",
        "planned-cut",
        "reliability",
        "running-cut",
        "tuning",
        "identification",
        "controller-page",
        "data",
    ),
    "Other systems": ("feed", "mtconnect", "mqtt", "shop", "flight-recorder"),
    "The simulator": ("training", "plant", "faults", "fault-matrix", "study", "pmac-emulation"),
    "The paper": ("paper", "paper-program"),
    "The code": ("screens", "../CONTRIBUTING", "testing", "performance", "../benchmarks/README", "../CHANGELOG"),
}
"""The pages in the order of the list beside them. One that is in `docs` and not here is listed last."""

LOADS = {
    "script": ("src",),
    "img": ("src", "srcset"),
    "source": ("src", "srcset"),
    "iframe": ("src",),
    "embed": ("src",),
    "object": ("data",),
    "video": ("src", "poster"),
    "audio": ("src",),
    "link": ("href",),
    "image": ("href",),
    "use": ("href",),
}
"""What of which element a browser fetches by itself; a link that somebody clicks is none of it."""

STATED = {"canonical", "license", "author", "next", "prev", "index", "search", "genindex"}
ELSEWHERE = re.compile(r"(?:https?:)?//[\w.-]", re.IGNORECASE)
STYLE = re.compile(r"(?:url\(\s*['\"]?|@import\s+['\"])((?:https?:)?//[^)'\"\s]+)", re.IGNORECASE)


class _Page(HTMLParser):
    """What one page fetches, links to, and can be linked at."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self._in_style = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name.split(":")[-1]: value or "" for name, value in attrs}
        self.anchors.update(values[name] for name in ("id", "name") if name in values)
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if tag != "link" or not STATED & set(values.get("rel", "").split()):
            self.fetched += [values[name] for name in LOADS.get(tag, ()) if name in values]
        self.fetched += STYLE.findall(values.get("style", ""))
        self._in_style = tag == "style"

    def handle_data(self, data: str) -> None:
        if self._in_style:
            self.fetched += STYLE.findall(data)

    def handle_endtag(self, tag: str) -> None:
        self._in_style = False


def fetched_from_elsewhere(folder: Path) -> Iterator[str]:
    """Yield what the pages, style sheets and pictures of a site would load from another computer."""
    for path in sorted(folder.rglob("*")):
        if path.suffix in {".html", ".svg"}:
            for address in _Page(path.read_text(encoding="utf-8")).fetched:
                if ELSEWHERE.match(address.strip()):
                    yield f"{path.relative_to(folder)} loads {address}"
        elif path.suffix == ".css":
            for address in STYLE.findall(path.read_text(encoding="utf-8")):
                yield f"{path.relative_to(folder)} loads {address}"


def broken_links(folder: Path) -> Iterator[str]:
    """Yield the links between the pages of a site that lead to no file, or to no place in it."""
    pages = {path.resolve(): _Page(path.read_text(encoding="utf-8")) for path in folder.rglob("*.html")}
    for path, page in sorted(pages.items()):
        for link in page.links:
            address, _, anchor = link.partition("#")
            if re.match(r"[a-z]+:|//", address):
                continue
            target = (path.parent / address).resolve() if address else path
            if not target.exists() or (anchor and target in pages and anchor not in pages[target].anchors):
                yield f"{path.relative_to(folder.resolve())} links to {link}"


def staged(folder: Path) -> None:
    """Put the documents into a folder as they stand beside each other, the README with the list of pages."""
    shutil.copytree(HERE, folder / "docs", ignore=shutil.ignore_patterns("*.py", "site_look", "__pycache__"))
    for name in DOCUMENTS:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (folder / "index.md").write_text("\n\n".join((readme, *_lists())) + "\n", encoding="utf-8")


def _lists() -> Iterator[str]:
    named = {page for pages in PARTS.values() for page in pages}
    more = sorted(path.stem for path in HERE.glob("*.md") if path.stem not in named)
    for title, pages in {**PARTS, "More": more}.items():
        entries = [page.removeprefix("../") if page.startswith("../") else f"docs/{page}" for page in pages]
        if entries:
            yield "\n".join(("```{toctree}", ":hidden:", f":caption: {title}", "", *entries, "```"))


def build(folder: Path) -> None:
    """Build the site into a folder.

    Raises:
        CalledProcessError: Sphinx found something wrong, and has said what.
    """
    with tempfile.TemporaryDirectory() as scratch:
        source, kept = Path(scratch) / "source", Path(scratch) / "kept"
        source.mkdir()
        staged(source)
        how = ("-q", "-W", "--keep-going", "-b", "html", "-c", str(HERE), "-d", str(kept))
        subprocess.run([sys.executable, "-m", "sphinx", *how, str(source), str(folder)], check=True)


def main(arguments: Sequence[str]) -> None:
    """Build the site into the folder given, and check it."""
    if len(arguments) != 1:
        raise SystemExit("python -m docs.site FOLDER")
    folder = Path(arguments[0])
    try:
        build(folder)
    except subprocess.CalledProcessError as error:
        raise SystemExit("the site does not build") from error
    wrong = (*fetched_from_elsewhere(folder), *broken_links(folder))
    if wrong:
        raise SystemExit("\n".join(wrong))
    print(f"{sum(1 for _ in folder.rglob('*.html'))} pages in {folder.name}: they load nothing from elsewhere")


if __name__ == "__main__":
    main(sys.argv[1:])
