"""Backup, verification and comparison of the controller's configuration, by the code of `console controller`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from console.session.data.controller_backups import (
    backup_path,
    compare_backup,
    fraction_done,
    seconds_left,
    write_backup,
)
from console.text.catalogue import Catalogue
from console.text.checks import MARKS
from console.tui.controller.errand import Errand
from console.tui.lines import BLANK, Line, dim, hanging, line, wrap_line
from console.tui.rows import list_rows
from console.tui.theme import Token
from drivers.commissioning.reading import expected_work, whole_card, work_done
from drivers.requests.permitted_lines import RequestKind
from drivers.requests.side_controller import SideController
from drivers.requests.side_line import SideLine
from profiles.files import printable
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.store import LoadedMachine

SHOWN = 12  # digits of a hash that are shown


@dataclass(frozen=True, slots=True, kw_only=True)
class FindingRow:
    """A finding as its group, mark and sentence."""

    group: str
    severity: Severity
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What an action found. `heading` says what; `sha256` is that of the controller where all of it was read."""

    action: str
    heading: str
    path: Path | None = None
    sha256: str = ""
    held: int = 0
    listed: tuple[FindingRow, ...] = ()


class ConfigurationReader:
    """Makes the work of an action, for a thread beside the screen."""

    def __init__(
        self, side: SideLine, machine: LoadedMachine, data: Path, text: Catalogue, *, simulated: bool = False
    ) -> None:
        self._side, self._loaded, self._data, self._text = side, machine, data, text
        self._simulated = simulated
        self.client = SideController(side, RequestKind.LISTING)

    @property
    def _machine(self) -> MachineProfile:
        return self._loaded.machine

    def backup(self) -> Result:
        """Write a backup of the whole controller into the data folder."""
        path = backup_path(self._data, self._machine.name)
        with self._side.working(reading=True):
            found = write_backup(self.client, self.client.dialect, path, private=True)
        heading = self._text(
            "controller_page.backup_done",
            settings=len(found.settings),
            plcs=len(found.plcs),
            programs=len(found.programs),
        )
        return Result(action="backup", heading=heading, path=path, sha256=found.fingerprint)

    def verify(self) -> Result:
        """Judge the controller by its profile and the rules of commissioning, as `console controller verify`."""
        from console.session.tuning.trial_checks import explained_checks
        from console.text.checks import check_fields, summary_line
        from drivers.commissioning.verification import in_order, verify

        with self._side.working(reading=True):
            verified = verify(self.client, self._machine, self.client.dialect)
        address, read = self.client.link.address, verified.judged.configuration
        trial = explained_checks(self._data, self._machine, address, read, simulated=self._simulated)
        checks = in_order([*verified.checks, *trial])
        unmet = [check for check in checks if check.severity is not Severity.OK]
        listed = tuple(
            FindingRow(group=check.group, severity=check.severity, sentence=str(fields["text"]))
            for check, fields in zip(unmet, check_fields(unmet, self._text), strict=True)
        )
        heading = summary_line(checks, self._text)
        return Result(action="verify", heading=heading, listed=listed, held=len(checks) - len(unmet))

    def diff(self, path: Path) -> Result:
        """Compare the controller with a backup, as `console controller diff`."""
        from console.text.checks import check_fields

        with self._side.working(reading=True):
            compared = compare_backup(self.client, self.client.dialect, self._machine, path)
        listed = tuple(
            FindingRow(group=check.group, severity=check.severity, sentence=str(fields["text"]))
            for check, fields in zip(compared.checks, check_fields(compared.checks, self._text), strict=True)
        )
        key = "configuration.differs_from" if listed else "configuration.no_difference"
        heading = self._text(key, count=len(listed), date=compared.date)
        return Result(action="diff", heading=heading, path=path, sha256=compared.sha256[1], listed=listed)


def doing_lines(action: str, errand: Errand[Result], side: SideLine, text: Catalogue, width: int) -> list[Line]:
    """Return what is being read, how far it is, and how long it takes yet where the whole controller is read."""
    rows = wrap_line(text(f"controller_page.doing.{action}", count=errand.requests), width, Token.ACTION)
    if action == "verify":
        return rows
    done = work_done(errand.requests, errand.answered_lines)
    fraction = fraction_done(done, expected_work(side.dialect, whole_card(side.dialect)))
    left_s = seconds_left(fraction, errand.elapsed_s)
    if left_s is not None:
        words = text("controller_page.doing.left", percent=f"{100.0 * fraction:.0f}", seconds=f"{left_s:.0f}")
        rows += wrap_line(words, width, Token.ACTION)
    return rows


def result_lines(found: Result, text: Catalogue, width: int) -> list[Line]:
    """Return what an action found, as a list."""
    good = not any(each.severity is Severity.REFUSAL for each in found.listed)
    rows = wrap_line(found.heading, width, Token.OK if good else Token.WARNING)
    if found.path is not None:
        rows += wrap_line(printable(str(found.path)), width, Token.DIM)
    if found.sha256:
        rows.append(line(dim(text("controller_page.hash", value=found.sha256[:SHOWN]))))
    group = ""
    for each in found.listed:
        if each.group != group:
            group = each.group
            rows += [BLANK, line((text(f"configuration.group.{group}"), Token.TITLE))]
        token = Token.WARNING if each.severity in (Severity.REFUSAL, Severity.WARNING) else Token.TEXT
        rows += hanging((f"{MARKS[each.severity]} ", token), each.sentence, width)
    return rows


def backup_lines(paths: tuple[Path, ...], chosen: int, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the backups of this machine around the selected one, newest first."""
    if not paths:
        return wrap_line(text("controller_page.no_backups"), width, Token.DIM)
    return list_rows([(printable(path.name), Token.TEXT) for path in paths], chosen, height, Token.SELECTED)
