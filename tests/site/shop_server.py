"""A PostgreSQL server for tests: one in a folder of its own, on a Unix socket, crashed and started on request."""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest

ACCOUNT = "postgres"
MODEL = "shop_model"
OWNER, SHIPPER, READER = "shop_owner", "lathe_shipper", "shop_reader"
START_S = 30
ROOT = Path(__file__).parents[2]


@cache
def programs() -> Path | None:
    """The folder of the newest server that is installed; Debian keeps it out of the PATH."""
    if os.geteuid() == 0 and ACCOUNT not in [each.pw_name for each in pwd.getpwall()]:
        return None  # it refuses to run as root, and its account is made by the package
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: int(path.parts[-3]))
    if found:
        return found[-1].parent
    on_path = shutil.which("initdb")
    return None if on_path is None else Path(on_path).parent


needs_postgresql = pytest.mark.skipif(
    programs() is None, reason="no PostgreSQL server is installed (Debian: apt-get install postgresql)"
)


def documented_sql(document: str, heading: str) -> list[str]:
    """The blocks of SQL below a heading of a document."""
    section = (ROOT / document).read_text(encoding="utf-8").split(f"\n{heading}\n", 1)[1]
    section = section.split("\n## ", 1)[0]
    blocks = section.split("```sql\n")[1:]
    return [block.partition("```")[0] for block in blocks]


class ShopServer:
    """A server. `dsn` names its database, for one of its roles."""

    def __init__(self, folder: Path, *, fsync: bool = False) -> None:
        self.folder = folder
        self._data, self._log = folder / "data", folder / "log"
        self._made = False
        self.options = f"-c listen_addresses='' -c fsync={'on' if fsync else 'off'}"

    def dsn(self, role: str = OWNER, database: str = "shop") -> str:
        return f"host={self.folder} dbname={database} user={role}"

    def create(self) -> None:
        words = ("-U", OWNER, "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync", "--no-instructions")
        self._run("initdb", "-D", str(self._data), *words)

    def start(self) -> None:
        options = f"{self.options} -c unix_socket_directories={self.folder}"
        self._run("pg_ctl", "-D", str(self._data), "-l", str(self._log), "-w", "-o", options, "start")

    def stop(self, mode: str = "fast") -> None:
        self._run("pg_ctl", "-D", str(self._data), "-m", mode, "stop")

    def crash(self) -> None:
        """End it as a crash does: what was not committed is gone, and it recovers at its next start."""
        self.stop("immediate")

    def sql(self, line: str, role: str = OWNER, database: str = "shop") -> list[tuple[object, ...]]:
        import psycopg

        with psycopg.connect(self.dsn(role, database), autocommit=True) as link:
            cursor = link.execute(line.encode())
            while cursor.nextset():
                pass
            return cursor.fetchall() if cursor.description else []

    def new_shop(self) -> None:
        """A database without records: a copy of one that was set up as the document says."""
        if not self._made:
            self._set_up(MODEL)
            self._made = True
        self.sql("DROP DATABASE IF EXISTS shop WITH (FORCE)", database="postgres")
        self.sql(f"CREATE DATABASE shop TEMPLATE {MODEL}", database="postgres")

    def _set_up(self, name: str) -> None:
        from console.site.shop.schema import migrate

        for role in (SHIPPER, READER):
            self.sql(f"CREATE ROLE {role} LOGIN", database="postgres")
        self.sql(f"CREATE DATABASE {name} ENCODING 'UTF8' TEMPLATE template0", database="postgres")
        migrate(self.dsn(database=name))
        for block in documented_sql("docs/shop.md", "### Rights"):
            self.sql(block, database=name)

    def _run(self, program: str, *words: str) -> None:
        folder = programs()
        assert folder is not None
        done = subprocess.run(
            [*as_server_account(), str(folder / program), *words],
            stdin=subprocess.DEVNULL,
            # The server keeps what it is given open: with pipes nobody would see the end.
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=self.folder,
            timeout=START_S,
            check=False,
        )
        assert done.returncode == 0, f"{program}: {self._log.read_text() if self._log.exists() else ''}"


def as_server_account() -> Sequence[str]:
    """The words before a program of the server, which refuses to run as root."""
    if os.geteuid() != 0:
        return ()
    account = pwd.getpwnam(ACCOUNT)
    return ("setpriv", f"--reuid={account.pw_uid}", f"--regid={account.pw_gid}", "--clear-groups")


@contextmanager
def shop_server(*, fsync: bool = False) -> Iterator[ShopServer]:
    """Yield a running server without the database of a shop; it is ended and removed afterwards.

    Without `fsync` it is as safe against a crash of its own as with it, though not against one of the computer.
    """
    # Not below a test's folder: the name of a socket has 107 characters at most, and root's folders are closed.
    folder = Path(tempfile.mkdtemp(prefix="shop-", dir="/tmp"))
    try:
        if os.geteuid() == 0:
            shutil.chown(folder, ACCOUNT)
        folder.chmod(0o755)
        server = ShopServer(folder, fsync=fsync)
        server.create()
        server.start()
        try:
            yield server
        finally:
            if (folder / "data" / "postmaster.pid").exists():
                server.stop("immediate")
    finally:
        shutil.rmtree(folder)


@pytest.fixture(scope="module")
def running() -> Iterator[ShopServer]:
    """A server for all tests of a module."""
    with shop_server() as server:
        yield server
