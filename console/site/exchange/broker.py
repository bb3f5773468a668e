"""Where a broker of MQTT is and who asks there, and what is refused of that."""

from __future__ import annotations

import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from console.session.errors import SessionError
from profiles.files import printable
from profiles.problem import Problem

USER, PASSWORD = "TRILOBE_MQTT_USER", "TRILOBE_MQTT_PASSWORD"
PORT, TLS_PORT = 1883, 8883
LONGEST_FILE = 4096
OF_OTHERS = stat.S_IRWXG | stat.S_IRWXO


@dataclass(frozen=True, slots=True, kw_only=True)
class Broker:
    """A broker; the password is in no text of it. `ca` are the certificates that it is checked with.

    With `tls` and without `ca` those of the system count.
    """

    host: str
    port: int
    tls: bool = False
    ca: Path | None = None
    user: str | None = None
    password: str | None = field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{'mqtts' if self.tls else 'mqtt'}://{self.host}:{self.port}"


def credentials(environment: Mapping[str, str], file: Path | None) -> tuple[str | None, str | None]:
    """Return user and password: the two lines of a file, else the variables; None where there are none.

    Raises SessionError: `mqtt.credentials`, the file cannot be read; `mqtt.credentials_open`, other accounts can;
    `mqtt.credentials_form`, it has no two lines.
    """
    if file is None:
        return environment.get(USER) or None, environment.get(PASSWORD) or None
    where = printable(str(file))
    try:
        with file.open("rb") as opened:
            if os.fstat(opened.fileno()).st_mode & OF_OTHERS:
                raise SessionError(Problem(code="mqtt.credentials_open", where=where))
            lines = opened.read(LONGEST_FILE).decode("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        value = error.strerror or str(error) if isinstance(error, OSError) else "UTF-8"
        raise SessionError(Problem(code="mqtt.credentials", where=where, value=value)) from None
    if len(lines) != 2 or not all(lines):
        raise SessionError(Problem(code="mqtt.credentials_form", where=where))
    return lines[0], lines[1]
