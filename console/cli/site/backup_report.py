"""What a backup holds, for people and for JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from console.cli.output import fields_of
from console.session.data.backup_format import Manifest
from profiles.files import printable


def backup_fields(manifest: Manifest, data: Path, file: str) -> dict[str, object]:
    """Return the facts of a backup, for JSON."""
    where = {"data": str(data), "file": file}
    return {
        **where,
        **fields_of(manifest, "created_utc", "software"),
        "files": len(manifest.files),
        "bytes": manifest.total_bytes,
    }


def backup_facts(manifest: Manifest, data: Path, file: str) -> dict[str, Any]:
    """Return the facts of a backup for its sentence."""
    return {
        "count": len(manifest.files),
        "size": f"{manifest.total_bytes / 1e6:.1f} MB",
        "data": printable(str(data)),
        "file": printable(file),
        "date": f"{printable(manifest.created_utc[:16].replace('T', ' '))} UTC",
    }
