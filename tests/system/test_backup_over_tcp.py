"""Backup, restore to a fresh controller, backup: the same text, user buffer included, over real sockets."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from drivers.clock import RealClock
from drivers.commissioning.backup import backup_text, read_backup
from drivers.commissioning.configuration import Configuration
from drivers.commissioning.reading import read_configuration, whole_card
from drivers.commissioning.restoring import refuse_other_memory, restore, restore_lines
from drivers.commissioning.user_buffer import read_words
from drivers.link.address import TcpAddress
from drivers.link.opening import TcpLink
from drivers.pmac.client import PmacClient

if TYPE_CHECKING:
    from tests.system.conftest import Serve

pytestmark = pytest.mark.system

LAST = {"pmac": 0x9FFF, "turbo": 0x107FF}
"""Where the memory for buffers ends, by the manuals."""

WORDS = 40
DATE = "2026-03-01T12:00:00+00:00"


@contextmanager
def connected(serve: Serve, family: str) -> Iterator[PmacClient]:
    with serve("--tcp", "127.0.0.1:0", "--dialect", family) as served:
        host, port = served.tcp
        with closing(TcpLink(TcpAddress(host=host, port=port))) as link:
            client = PmacClient(link, RealClock())
            client.connect()
            yield client


def read(client: PmacClient) -> Configuration:
    """Everything but most of what takes time: the settings and variables of the factory."""
    extent = replace(
        whole_card(client.dialect, values=False),
        settings=(range(200),),
        pointers=(range(50),),
        plcs=(1,),
        programs=(1, 2),
    )
    found = read_configuration(client, client.dialect, extent)
    return replace(
        found, values={}, user_words=read_words(client, found.user_buffer) if found.user_buffer else None
    )


@pytest.mark.parametrize("family", LAST)
def test_backup_restore_backup_is_identical_with_a_user_buffer(serve: Serve, family: str) -> None:
    first = LAST[family] - WORDS + 1
    with connected(serve, family) as client:
        lines = (f"DEFINE UBUFFER {WORDS}", f"WX:${first:X},1,$FFFFFF", f"WY:${first + WORDS - 1:X},$ABCDEF")
        for line in (*lines, "OPEN PROG1 CLEAR", "INC X10", "CLOSE"):
            client.request(line, lines=0)
        text = backup_text(read(client), DATE)
    assert f"\nDEFINE UBUFFER {WORDS}\n" in text
    backup = read_backup(text, "file")
    with connected(serve, family) as client:
        now = read(client)
        refuse_other_memory(backup, now, "here")
        restore(client, client.dialect, restore_lines(text, backup, now))
        assert backup_text(read(client), DATE) == text
