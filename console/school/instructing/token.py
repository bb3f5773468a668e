"""The token that an instructor has to know, kept in a file of its owner alone while a console listens."""

from __future__ import annotations

import hmac
import os
import secrets
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from console.session.data.kept_files import file_errors, make_folder
from drivers.link.address import TcpAddress
from drivers.simulator.hosts.control_address import ControlAddress
from profiles.files import read_regular_file
from profiles.problem import ProfileError

FOLDER = "instructor"
LONGEST = 200
_OWNER_ONLY = 0o600


def token_path(data: Path, address: ControlAddress) -> Path:
    """Return the file of the console that listens at an address."""
    if isinstance(address, TcpAddress):
        return data / FOLDER / f"tcp-{address.port}.token"
    place = os.path.abspath(address.path).encode("utf-8", "surrogateescape")
    return data / FOLDER / f"unix-{sha256(place).hexdigest()[:12]}.token"


def new_token() -> str:
    """Return a token that nobody guesses."""
    return secrets.token_urlsafe(24)


def keep_token(path: Path, token: str) -> None:
    """Write it into a file for its owner alone, also in a folder that a group shares.

    Raises ProfileError: `file.not_writable`.
    """
    make_folder(path.parent)
    with file_errors("file.not_writable", path):
        path.unlink(missing_ok=True)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, _OWNER_ONLY)
        with open(descriptor, "w", encoding="ascii") as file:
            file.write(f"{token}\n")


def kept_token(path: Path) -> str:
    """Return the token in a file. Raises ProfileError: `file.unreadable` and the like."""
    return read_regular_file(path, cap_bytes=LONGEST).decode("utf-8", "replace").strip()


def forget_token(path: Path, token: str) -> None:
    """Remove the file, unless another console has written its own there."""
    with suppress(OSError, ProfileError):
        if kept_token(path) == token:
            path.unlink()


def is_token(given: str, token: str) -> bool:
    """Whether it is the token; how long that takes reveals nothing about it."""
    return hmac.compare_digest(given.encode("utf-8", "replace"), token.encode("ascii"))
