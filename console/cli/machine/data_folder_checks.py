"""Checks of the data folder for `console doctor`: where it is, whose, its rights and its free space."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from console.session.data.folder_state import LITTLE_BYTES, FolderState, state_of
from drivers.commissioning.check import Check, Group
from profiles.files import printable
from profiles.findings import Severity


def data_folder_checks(data: Path) -> list[Check]:
    """Return one check of the data folder where it is in order, else one for each thing that is not."""
    where = printable(str(data.absolute()))
    try:
        state = state_of(data)
    except OSError as error:
        return [_check("data_folder_unusable", Severity.REFUSAL, where, found=error.strerror or str(error))]
    if state is None:
        above = next(each for each in data.absolute().parents if each.exists())
        if not os.access(above, os.W_OK | os.X_OK):
            return [_check("data_folder_unmakeable", Severity.REFUSAL, where, found=printable(str(above)))]
        return [_check("data_folder_missing", Severity.NOTICE, where)]
    if not state.usable:
        return [_check("data_folder_unusable", Severity.REFUSAL, where, found=state.rights)]
    return _check_folder_state(state, where) or [
        _check(
            "data_folder_shared" if state.shared else "data_folder_private",
            Severity.OK,
            where,
            found=state.rights,
            wanted=state.group,
            free=state.free_space,
        )
    ]


def _check_folder_state(state: FolderState, where: str) -> list[Check]:
    found, mode, checks = state.rights, state.mode, []
    if mode & stat.S_IWOTH:
        checks.append(_check("data_folder_open", Severity.REFUSAL, where, found=found))
    elif mode & stat.S_ISGID and not mode & stat.S_IWGRP and mode & stat.S_IXGRP:
        checks.append(_check("data_folder_half", Severity.WARNING, where, found=found, wanted=state.group))
    elif mode & stat.S_IWGRP and not mode & stat.S_ISGID:
        checks.append(_check("data_folder_not_setgid", Severity.WARNING, where, found=found, wanted=state.group))
    elif state.shared and mode & stat.S_ISVTX:
        checks.append(_check("data_folder_sticky", Severity.WARNING, where, found=found))
    if state.closed:
        code = "data_folder_closed" if state.shared else "data_folder_foreign"
        first = printable(str(state.closed[0].relative_to(state.path)))
        count = str(len(state.closed))
        checks.append(_check(code, Severity.WARNING, where, found=first, wanted=state.group, number=count))
    if state.free_bytes < LITTLE_BYTES:
        checks.append(_check("data_folder_full", Severity.WARNING, where, found=state.free_space))
    return checks


def _check(code: str, severity: Severity, where: str, *, found: str = "", wanted: str = "", **facts: str) -> Check:
    facts = {"where": where, **facts}
    return Check(group=Group.COMPUTER, code=code, severity=severity, found=found, wanted=wanted, facts=facts)
