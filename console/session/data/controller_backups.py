"""Backups of a controller's configuration: written, listed, and compared with the controller as it is."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from console.session.data.kept_files import folder_name, make_folder, names_in
from profiles.files import printable, read_regular_file, write_atomically

if TYPE_CHECKING:
    from drivers.commissioning.backup import Backup
    from drivers.commissioning.check import Check
    from drivers.commissioning.configuration import ControllerConfiguration
    from drivers.commissioning.user_buffer import Seen
    from drivers.controller import Controller
    from drivers.pmac.dialect import Dialect
    from profiles.machine import MachineProfile

FIRST_ESTIMATE = 0.02  # fraction done from which the pace says anything
MOST = 0.99  # of work that has not ended and whose amount is an estimate


def fraction_done(done: float, whole: float) -> float:
    """Return how much of some work is done; never all of it."""
    return min(done / whole, MOST)


def seconds_left(fraction: float, elapsed_s: float) -> float | None:
    """Return the time left at the pace so far, None while too little is done to tell."""
    return None if fraction < FIRST_ESTIMATE else elapsed_s * (1.0 - fraction) / fraction


FOLDER, SUFFIX = "backups", ".pmac"
MOST_LISTED = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class BackupComparison:
    """What differs now from a backup of `date`. `sha256` are the hashes of the backup and of the controller."""

    date: str
    checks: tuple[Check, ...]
    sha256: tuple[str, str]


def backup_path(data: Path, machine: str) -> Path:
    """Return where a backup of now goes; a second one in the same second gets a name of its own."""
    stamp = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
    name = f"{folder_name(machine)}-{stamp}"
    path, more = data / FOLDER / f"{name}{SUFFIX}", 2
    while path.exists():
        path, more = data / FOLDER / f"{name}-{more}{SUFFIX}", more + 1
    return path


def backups_of(data: Path, machine: str) -> tuple[Path, ...]:
    """Return the backups of a machine in the data folder, newest first by their names.

    Raises ProfileError: `file.unreadable`.
    """
    named = f"{folder_name(machine)}-"
    kept = (path for path in names_in(data / FOLDER, SUFFIX) if path.name.startswith(named))
    return tuple(sorted(kept, key=lambda path: path.name, reverse=True))[:MOST_LISTED]


def write_backup(
    client: Controller,
    dialect: Dialect,
    path: Path,
    *,
    private: bool = False,
    values: bool = False,
    seen_words: Seen = lambda done, of: None,
) -> ControllerConfiguration:
    """Back up the whole controller to a file, `private` for its owner alone; never overwrite.

    With the `values` of P, Q and M, the entries of tables and the words of the user buffer, where they are asked
    for: they take longest. `seen_words` takes how far the user buffer is.

    Raises ProfileError: `file.exists`, `file.not_writable`; DriverError: as `read_configuration`.
    """
    from drivers.commissioning.reading import read_configuration, whole_card

    configuration = read_configuration(client, dialect, whole_card(dialect, values=values), seen_words)
    keep_backup(configuration, path, private=private)
    return configuration


def keep_backup(configuration: ControllerConfiguration, path: Path, *, private: bool = False) -> None:
    """Write what was read to a file; never overwrite. Raises ProfileError: `file.exists`, `file.not_writable`."""
    from drivers.commissioning.backup import backup_text

    date = datetime.now().astimezone().isoformat(timespec="seconds")
    if private:
        make_folder(path.parent)
    write_atomically(path, backup_text(configuration, date).encode("utf-8"), overwrite=False, private=private)


def load_backup(path: Path) -> tuple[str, Backup]:
    """Return the text of a backup, and what it has. Raises ProfileError: no such file, or no backup."""
    from drivers.commissioning.backup import CAP_BYTES, read_backup

    text = read_regular_file(path, cap_bytes=CAP_BYTES).decode("utf-8", "replace")
    return text, read_backup(text, printable(str(path)))


def compare_backup(client: Controller, dialect: Dialect, machine: MachineProfile, path: Path) -> BackupComparison:
    """Read the whole controller, and return what differs from a backup.

    Raises ProfileError: no such file, or no backup; RefusedError: `controller.backup_family`; DriverError: as
        `read_configuration`.
    """
    from drivers.commissioning.comparison import differences
    from drivers.commissioning.reading import read_configuration, whole_card
    from drivers.commissioning.restoring import refuse_other_family
    from drivers.commissioning.verification import in_order

    _, backup = load_backup(path)
    refuse_other_family(backup.configuration, dialect, printable(str(path)))
    now = read_configuration(client, dialect, whole_card(dialect, programs=backup.configuration.sought_programs))
    return BackupComparison(
        date=backup.date,
        checks=in_order(differences(backup.configuration, now, machine)),
        sha256=(backup.configuration.fingerprint, now.fingerprint),
    )
