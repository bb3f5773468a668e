"""Who the controller is, as it answers: asked when the page is shown, and with Enter."""

from __future__ import annotations

from dataclasses import dataclass

from console.session.station.state import StationState
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, NOTHING, Line, dim, fitted, line, wrapped
from console.tui.theme import Token
from drivers.beside.side_controller import SideController
from drivers.errors import ControllerError
from profiles.machine import MachineProfile

WORDS = ("TYPE", "VERSION", "DATE", "CID", "CPU", "VID", "SIZE")
_LABEL = 22


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """What the controller answers; `words` by their names, those that it has. `servo_ms` from I10."""

    words: dict[str, str]
    servo_ms: float


def read_identity(client: SideController) -> Identity:
    """Ask for it. Raises DriverError, as `SideController.query`."""
    words = {}
    for word in WORDS:
        try:
            (answer,) = client.query(word, again=True)
        except ControllerError:  # this family does not have it
            continue
        words[word] = answer.strip()
    (servo,) = client.numbers("I10", again=True)
    return Identity(words=words, servo_ms=servo / 8_388_608.0)


def identity_lines(
    found: Identity | None,
    state: StationState,
    machine: MachineProfile,
    faults: int,
    text: Catalogue,
    width: int,
    client: str = "",
) -> list[Line]:
    """Return the lines, also before anything was answered. `client`: where a terminal comes from, "" for here."""
    controller, values = machine.controller, list[tuple[str, str]]()
    kind = state.controller or NOTHING
    values.append((text("controller_page.identity.controller"), kind))
    values.append((text("controller_page.identity.address"), state.address or NOTHING))
    profile = f"{machine.name}, {controller.family}"
    values.append((text("controller_page.identity.profile"), profile))
    if found is not None:
        values += [
            (text(f"controller_page.identity.{word.lower()}"), answer)
            for word, answer in found.words.items()
            if word not in ("TYPE", "VERSION")
        ]
        servo = f"{found.servo_ms:.4f} ms ({controller.servo_period_ms:.4f} ms)"
        values.append((text("controller_page.identity.servo"), servo))
    link = f"{state.round_trip_ms:.1f} ms"
    values.append((text("controller_page.identity.round_trip"), link))
    values.append((text("controller_page.identity.faults"), str(faults)))
    standing = text("controller_page.identity.controls" if state.controls else "controller_page.identity.observes")
    values.append((text("controller_page.identity.standing"), standing))
    at = text("controller_page.identity.far", client=client) if client else text("controller_page.identity.here")
    values.append((text("controller_page.identity.terminal"), at))
    rows = [line(dim(fitted(label, _LABEL)), value) for label, value in values]
    return [*rows, BLANK, *commissioned_lines(state, text, width)]


def commissioned_lines(state: StationState, text: Catalogue, width: int) -> list[Line]:
    """Return whether the controller is as it was commissioned, as far as it was compared."""
    settings = state.alignment.settings
    rows = [line((text("controller_page.commissioned"), Token.TITLE))]
    if settings is None:
        return [*rows, line(dim(text("controller_page.settings.unread")))]
    if settings:
        rows += wrapped(text("controller_page.settings.differ", count=len(settings)), width, Token.WARNING)
        for problem in settings:
            rows += wrapped("· " + text.problem(problem), width)
    else:
        rows.append(line((text("controller_page.settings.agree"), Token.OK)))
    for problem in state.uncommissioned:
        rows += wrapped("· " + text.problem(problem), width, Token.WARNING)
    if not state.uncommissioned:
        key = "simulated" if state.simulated else "recorded"
        rows += wrapped(text(f"controller_page.stops.{key}"), width)
    return rows
