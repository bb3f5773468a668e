"""Actions of `console controller` on a configuration: back up, verify, compare, apply."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path

from console.cli.library import data_of, refuse_unsigned
from console.cli.machine.card_access import Card
from console.cli.machine.card_lines import card_fields, card_line
from console.cli.machine.check_fields import check_fields
from console.cli.machine.check_lines import check_lines, summary_line
from console.cli.machine.signature_checks import signature_checks
from console.cli.output import print_json
from console.session.data.kept_files import make_folder
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from drivers.commissioning.backup import CAP_BYTES, backup_text, read_backup
from drivers.commissioning.comparison import differences
from drivers.commissioning.configuration import Configuration
from drivers.commissioning.gains import Write, apply, gain_writes, refuse_unready
from drivers.commissioning.judged import Judged
from drivers.commissioning.reading import read_configuration, whole_card
from drivers.commissioning.verification import in_order, read_of_machine, verify
from drivers.errors import RefusedError
from drivers.lathe.ownership import Ownership
from profiles.files import printable, read_regular_file, write_atomically
from profiles.findings import Severity, worst
from profiles.problem import Problem

BACKUP_FOLDER = "backups"
WITH_A_FILE = ("backup", "diff")


def _backup(options: Namespace, card: Card, text: Catalogue) -> int:
    configuration = _written(card, Path(options.file))
    counts = {
        "settings": len(configuration.settings),
        "axes": len(configuration.axes),
        "plcs": len(configuration.plcs),
        "programs": len(configuration.programs),
    }
    if options.json:
        print_json({**card_fields(card), "file": options.file, **counts, "fingerprint": configuration.fingerprint})
        return 0
    shown = {**counts, "count": counts["settings"], "file": printable(options.file)}
    print(card_line(card, text))
    print(text("card.backup_done", **shown))
    return 0


def _verify(options: Namespace, card: Card, text: Catalogue) -> int:
    verified = verify(card.client, card.machine, card.dialect).checks
    checks = in_order([*verified, *signature_checks(card)])
    told = checks if options.json else tuple(c for c in checks if c.severity is not Severity.OK)
    if options.json:
        print_json({**card_fields(card), "checks": check_fields(told, text)})
    else:
        print("\n".join([card_line(card, text), *check_lines(told, text), "", summary_line(checks, text)]))
    return 1 if worst(checks) is Severity.REFUSAL else 0


def _diff(options: Namespace, card: Card, text: Catalogue) -> int:
    path = Path(options.file)
    content = read_regular_file(path, cap_bytes=CAP_BYTES).decode("utf-8", "replace")
    backup = read_backup(content, printable(options.file))
    if backup.configuration.family != card.dialect.name:
        found, here = backup.configuration.family, card.dialect.name
        where = printable(options.file)
        raise RefusedError(Problem(code="controller.backup_family", where=where, value=found, limit=here))
    now = read_configuration(card.client, card.dialect, whole_card(card.dialect))
    checks = in_order(differences(backup.configuration, now, card.machine))
    if options.json:
        print_json({**card_fields(card), "date": backup.date, "differences": check_fields(checks, text)})
        return 1 if checks else 0
    said = (
        text("card.differs_from", count=len(checks), date=backup.date)
        if checks
        else text("card.no_difference", date=backup.date)
    )
    print("\n".join([card_line(card, text), said, *check_lines(checks, text)]))
    return 1 if checks else 0


def _apply(options: Namespace, card: Card, text: Catalogue) -> int:
    if options.yes and not card.simulated:
        refuse_unsigned(card.machine)
    judged = Judged(configuration=read_of_machine(card.client, card.machine, card.dialect), machine=card.machine)
    writes = gain_writes(judged)
    backup = _backup_path(options, card) if writes and options.yes else None
    if backup is not None:
        refuse_unready(card.client, card.dialect)
        make_folder(backup.parent)
        _written(card, backup, private=True)
        _apply_whole(card, writes)
    if options.json:
        lines = [{"line": write.line, "found": write.found} for write in writes]
        file = None if backup is None else str(backup)
        print_json({**card_fields(card), "lines": lines, "applied": backup is not None, "backup": file})
    else:
        print("\n".join([card_line(card, text), *_applied(writes, backup, text)]))
    return 0


def _apply_whole(card: Card, writes: tuple[Write, ...]) -> None:
    """Write everything with control of the machine; a signal ends the command after control is released.

    Raises:
        DriverError: another console controls it; the controller refuses a line; the link broke.
    """
    interruption = Interruption()
    interruption.install()
    ownership = Ownership(card.client)
    with interruption.holding():
        try:
            ownership.claim()
            apply(card.client, card.dialect, writes)
        finally:
            ownership.release()


def _applied(writes: tuple[Write, ...], backup: Path | None, text: Catalogue) -> list[str]:
    if not writes:
        return [text("card.nothing_to_apply")]
    lines = [f"  {text('card.line', line=write.line, found=write.found)}" for write in writes]
    if backup is None:
        return [text("card.dry_run"), *lines]
    first = text("card.backup_first", file=printable(str(backup)))
    return [first, *lines, text("card.applied", count=len(writes))]


def _backup_path(options: Namespace, card: Card) -> Path:
    stamp = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
    return data_of(options) / BACKUP_FOLDER / f"{card.machine.name}-{stamp}.pmac"


def _written(card: Card, path: Path, *, private: bool = False) -> Configuration:
    """Back up the whole controller to a file, `private` for its owner alone; never overwrite.

    Raises:
        ProfileError: `file.exists`, `file.not_writable`.
        DriverError: the controller cannot be read.
    """
    configuration = read_configuration(card.client, card.dialect, whole_card(card.dialect))
    date = datetime.now().astimezone().isoformat(timespec="seconds")
    write_atomically(path, backup_text(configuration, date).encode("utf-8"), overwrite=False, private=private)
    return configuration


WORKS: Mapping[str, Callable[[Namespace, Card, Catalogue], int]] = {
    "backup": _backup,
    "verify": _verify,
    "diff": _diff,
    "apply": _apply,
}
