"""Commands for the kinematic programs of the addressed coordinate system: OPEN, LIST and DELETE."""

from __future__ import annotations

from drivers.pmac.execution.kinematics import KINDS
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.simulator.card import buffers
from drivers.simulator.commands.buffer_words import take_part
from drivers.simulator.context import Context, Filling, Handler, Reading, Step


def _refuse_without(reading: Reading) -> None:
    if reading.dialect.kinematics is None:
        raise PmacError(ErrorCode.DATA_ERROR, "this family has no kinematic programs")


def _open(kind: str) -> Handler:
    def read(scanner: Scanner, reading: Reading) -> Step:
        _refuse_without(reading)
        reading.filling = Filling.KINEMATIC
        return lambda context: buffers.open_kinematic(context, kind)

    return read


def _list(kind: str) -> Handler:
    def read(scanner: Scanner, reading: Reading) -> Step:
        _refuse_without(reading)
        part = take_part(scanner)

        def step(context: Context) -> None:
            buffers.refuse_locked(context.controller)
            lines = context.system.kinematic_lines.get(kind)
            if lines is None:
                raise PmacError(ErrorCode.DATA_ERROR, f"&{context.system_number} has no {kind} program")
            context.list_lines(part.of(lines, context))

        return step

    return read


def _delete(kind: str) -> Handler:
    def read(scanner: Scanner, reading: Reading) -> Step:
        _refuse_without(reading)
        return lambda context: buffers.delete_kinematic(context, kind)

    return read


WORDS: dict[str, Handler] = {
    **{f"OPEN{word}": _open(kind) for word, kind in KINDS.items()},
    **{f"LIST{word}": _list(kind) for word, kind in KINDS.items()},
    **{f"{delete}{word}": _delete(kind) for delete in ("DELETE", "DEL") for word, kind in KINDS.items()},
}
