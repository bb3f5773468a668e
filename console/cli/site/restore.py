"""`console restore`: a data folder from its backup."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the file to read."""
    parser.add_argument("file", metavar="FILE.tar.gz", help=text("help.restore.file"))


def main(options: Namespace, text: Catalogue) -> int:
    """Restore, and print what was restored where."""
    from console.cli.library import data_of
    from console.cli.output import show, tell
    from console.cli.site.backup_report import backup_facts, backup_fields
    from console.session.data.restore import restore

    data = data_of(options)
    manifest, left_out = restore(Path(options.file), data)
    warnings = tell(left_out, text)
    facts = backup_facts(manifest, data, options.file)
    show(
        options,
        lambda: {**backup_fields(manifest, data, options.file), "warnings": warnings},
        lambda: [text("restore.done", **facts)],
    )
    return 0
