"""HTML and SVG as text, written by functions: whatever is not markup already is escaped here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from console.escaping import escape_text

VOID = frozenset({"meta", "br", "hr", "col"})

Attribute = str | int | float | None


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def escape_markup(text: str) -> Markup:
    """Return a text as HTML; characters that HTML does not allow are shown by their code."""
    return text if isinstance(text, Markup) else Markup(escape(escape_text(text)))


def join_markup(parts: Iterable[str | None]) -> Markup:
    """Return several texts or elements as one; None is left out."""
    return Markup("".join(escape_markup(part) for part in parts if part is not None))


def element(name: str, /, *children: str | None, **attributes: Attribute) -> Markup:
    """Return an element; None is left out, of its children and of its attributes.

    Names of attributes are written with underscores, those that are words of Python with one at the end.
    """
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape_markup(_value(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in VOID:
        return Markup(f"<{name}{written}>")
    return Markup(f"<{name}{written}>{join_markup(children)}</{name}>")


def _value(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:z.2f}".rstrip("0").rstrip(".")


def paragraph(*children: str | None, **attributes: Attribute) -> Markup:
    """Return a paragraph."""
    return element("p", *children, **attributes)


def facts_table(caption: str, rows: Sequence[tuple[str, str]], style: str = "") -> Markup:
    """Return a table of facts: a name and a value in each row."""
    body = (element("tr", element("th", name, scope="row"), element("td", value)) for name, value in rows)
    return element("table", element("caption", caption), element("tbody", *body), class_=f"facts {style}".rstrip())


def table(
    caption: str,
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    numeric: Iterable[int] = (),
    style: str | None = None,
) -> Markup:
    """Return a table; the first cell of each row is its name, `numeric` columns are aligned to the right."""
    right = frozenset(numeric)

    def kind(place: int) -> str | None:
        return "number" if place in right else None

    titles = (element("th", cell, scope="col", class_=kind(place)) for place, cell in enumerate(head))
    body = (
        element(
            "tr",
            element("th", row[0], scope="row", class_=kind(0)),
            *(element("td", cell, class_=kind(place)) for place, cell in enumerate(row[1:], start=1)),
        )
        for row in rows
    )
    return element(
        "table",
        element("caption", caption),
        element("thead", element("tr", *titles)),
        element("tbody", *body),
        class_=style,
    )


def list_of(lines: Iterable[str]) -> Markup:
    """Return a list of lines."""
    return element("ul", *(element("li", each) for each in lines))


def section(name: str, title: str, *children: str | None) -> Markup:
    """Return a section with its heading; `name` is its id."""
    return element("section", element("h2", title), *children, id=name)
