"""`console gauges`: the gauges, and which of them the screens take as the one that measures the parts."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from console.cli.commands import add_actions
from console.cli.library import data_of
from console.cli.output import show, tell
from console.cli.parser import Parser
from console.cli.part.library_list import Listed, fields_of_entry, list_library, sentences
from console.session.data.kept_files import gauges_folder, make_folder
from console.session.gauge_in_use import chosen_gauge, use_gauge
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.files import printable, read_toml, write_atomically
from profiles.gauge import GAUGE_FIELDS, GaugeProfile
from profiles.problem import Problem, ProfileError
from profiles.store import list_gauges, load_gauge, unfit_name

ACTIONS = ("list", "show", "copy", "use")
NOBODY = "none"  # no gauge


def add(parser: Parser, text: Catalogue) -> None:
    """Add the actions, each with its arguments."""
    actions = add_actions(parser, "gauges", ACTIONS, text, required=False)
    actions["use"].add_argument("name", metavar="NAME|none", help=text("help.gauges.name"))
    for action in ("show", "copy"):
        actions[action].add_argument("source", metavar="GAUGE", help=text("help.gauge"))
    actions["copy"].add_argument("name", metavar="NAME", help=text("help.gauges.copied"))


def main(options: Namespace, text: Catalogue) -> int:
    """List every gauge by the name that `--gauge` takes, an unreadable one with its reason; or act on one."""
    data = data_of(options)
    if options.action in ("show", "copy"):
        act = _show if options.action == "show" else _copy
        act(options, gauges_folder(data), text)
        return 0
    if options.action == "use":
        name = None if options.name == NOBODY else options.name
        use_gauge(data, name)
        said = text("gauges.used_none" if name is None else "gauges.used", name=printable(options.name))
        show(options, lambda: {"in_use": name}, lambda: [said])
        return 0
    found, used = list_library(list_gauges(gauges_folder(data)), load_gauge), chosen_gauge(data).gauge
    show(
        options,
        lambda: {"gauges": [_fields(each, text) for each in found], "in_use": used},
        lambda: _lines(found, used, text),
    )
    return 0


def _show(options: Namespace, folder: Path, text: Catalogue) -> None:
    """Show what the file of a gauge states; its unit stands beside each amount."""
    from console.session.learning.gauge_errors import newest_error, undeclared_error

    gauge = load_gauge(options.source, folder)
    stated = {field: getattr(gauge, field.key) for field in GAUGE_FIELDS}
    rows = [
        (
            field.key,
            text("budget.unknown") if value is None else printable(str(value)),
            "" if value is None else field.unit,
        )
        for field, value in stated.items()
    ]
    warnings = tell(undeclared_error(gauge, newest_error(folder.parent, gauge.name)), text)
    fields = {**{field.key: value for field, value in stated.items()}, "warnings": warnings}
    show(options, lambda: fields, lambda: table(rows))


def _copy(options: Namespace, folder: Path, text: Catalogue) -> None:
    """Write the file of a gauge under another name into the data folder, comments and all."""
    import tomlkit  # slow to import, and only a copy needs it

    load_gauge(options.source, folder)
    known = {each.name: each.path for each in list_gauges(folder)}
    if options.name in known:
        raise ProfileError(Problem(code="gauge.name_taken", value=printable(options.name)))
    if problem := unfit_name(options.name):
        raise ProfileError(problem)
    document = tomlkit.parse(read_toml(known.get(options.source, Path(options.source)))[0].decode())
    document["name"] = options.name
    path = folder / f"{options.name}.toml"
    make_folder(folder)
    write_atomically(path, tomlkit.dumps(document).encode(), overwrite=False, private=True)
    said = text("gauges.copied", path=printable(str(path)))
    show(options, lambda: {"name": options.name, "path": str(path)}, lambda: [said])


def _fields(each: Listed[GaugeProfile], text: Catalogue) -> dict[str, object]:
    _, loaded = each
    fields = fields_of_entry(each, text)
    if not isinstance(loaded, GaugeProfile):
        return fields
    return {**fields, **{field.key: getattr(loaded, field.key) for field in GAUGE_FIELDS}}


def _lines(found: list[Listed[GaugeProfile]], used: str | None, text: Catalogue) -> list[str]:
    """Return a row for each gauge, then why some cannot be read."""
    rows = [tuple(text(f"gauges.{name}") for name in ("name", "spindle", "certificate", "rule", "origin"))]
    for entry, loaded in found:
        name = printable(entry.name) + (f" {text('gauges.in_use')}" if entry.name == used else "")
        origin = text("jobs.bundled" if entry.bundled else "jobs.own")
        if isinstance(loaded, GaugeProfile):
            spindle, stated = loaded.spindle_error_um, loaded.roundness_u_um
            amounts = (_amount(spindle, text), _amount(stated, text))
            rows.append((name, *amounts, text(f"judged.rule.{loaded.rule}"), origin))
        else:
            rows.append((name, text("jobs.unreadable"), "", "", origin))
    return [*table(rows), *sentences(found, text)]


def _amount(um: float | None, text: Catalogue) -> str:
    return text("budget.unknown") if um is None else f"{um:g} um"
