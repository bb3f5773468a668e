"""A file that is to be sent to a controller: read and checked as `console check-program` does, or refused."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from console.cli.part.check_program_report import finding_sentence
from console.cli.part.program_file import checked_file, read_file
from console.text.catalogue import Catalogue
from drivers.commissioning.downloadable import badly_formed, refusals
from drivers.errors import RefusedError
from drivers.pmac.analysis.findings import ProgramFinding
from drivers.pmac.analysis.program import refused_findings
from drivers.pmac.buffer_text import BufferKind, TextBuffer
from profiles.files import printable
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import Problem

MOST_SAID = 20
"""Reasons that are named one by one."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """What a file has to send, and the warnings and notices of its check."""

    buffers: tuple[TextBuffer, ...]
    findings: tuple[ProgramFinding, ...]

    @property
    def programs(self) -> tuple[int, ...]:
        """The numbers of its motion programs."""
        return tuple(each.number for each in self.buffers if each.kind is BufferKind.PROGRAM)


def read_source(path: Path, machine: MachineProfile, text: Catalogue) -> Source:
    """Read a file and check it; nothing is sent.

    Raises:
        ProblemError: as `checked_file`.
        RefusedError: `download.check`, what the check refuses; and the codes of `refusals` and `badly_formed`.
    """
    where = printable(str(path))
    read, refused = read_file(path, machine)
    findings = tuple(refused_findings(refused))
    if any(buffer.kind is BufferKind.PROGRAM for buffer in read.source.buffers):
        findings = checked_file(path, machine).findings
    outside = {line.place for line in read.source.outside}
    problems = [
        *refusals(read.source, where, machine.controller.family),
        *(
            Problem(code="download.check", where=where, value=finding_sentence(finding, text))
            for finding in findings
            if finding.severity is Severity.REFUSAL and not (finding.lines and outside.issuperset(finding.lines))
        ),
    ]
    problems = problems or list(badly_formed(read.source.buffers, where))
    _refuse(problems, where)
    return Source(buffers=read.source.buffers, findings=findings)


def _refuse(said: list[Problem], where: str) -> None:
    if len(said) > MOST_SAID:
        more = Problem(code="download.more", where=where, value=str(len(said) - MOST_SAID))
        said = [*said[:MOST_SAID], more]
    if said:
        raise RefusedError(*said)
