"""What a backup holds, for people and for JSON."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable

from console.cli.library import data_of
from console.cli.output import fields_of, show, tell
from console.session.data.backup_format import Manifest
from console.text.catalogue import Catalogue
from profiles.files import printable
from profiles.problem import Problem


def show_backup(options: Namespace, manifest: Manifest, left_out: Iterable[Problem], text: Catalogue) -> None:
    """Print what was backed up or restored, by the sentence `COMMAND.done`; what was left out is a warning."""
    data, file, warnings = data_of(options), options.file, tell(left_out, text)
    facts = {
        "count": len(manifest.files),
        "size": f"{manifest.total_bytes / 1e6:.1f} MB",
        "data": printable(str(data)),
        "file": printable(file),
        "date": f"{printable(manifest.created_utc[:16].replace('T', ' '))} UTC",
    }
    show(
        options,
        lambda: {
            **{"data": str(data), "file": file},
            **fields_of(manifest, "created_utc", "software"),
            **{"files": len(manifest.files), "bytes": manifest.total_bytes, "warnings": warnings},
        },
        lambda: [text(f"{options.command}.done", **facts)],
    )
