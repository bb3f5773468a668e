"""How a lathe reaches the shop: passwords stay where they belong, the network is encrypted, roles are small."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from console.session.errors import SessionError
from console.site.shop.connection import connect_shop
from console.site.shop.shipping import ship
from tests.site.shop_server import OWNER, SHIPPER, ShopServer, as_server_account, needs_postgresql, shop_server
from tests.system.site.lathe_records import record_runs

pytestmark = [
    pytest.mark.system,
    needs_postgresql,
    pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not installed"),
]

PASSWORD = "Zw3tschge!"


@pytest.fixture(scope="module")
def guarded() -> Iterator[tuple[ShopServer, int]]:
    """A server with TLS on a port of this computer, at which the lathe needs its password."""
    import socket

    with shop_server() as server:
        server.new_shop()
        server.sql(f"ALTER ROLE {SHIPPER} PASSWORD '{PASSWORD}'")
        certificate(server)
        server.stop()
        rules = server.folder / "data" / "pg_hba.conf"
        rules.write_text(f"local all {OWNER} trust\nhost all all all scram-sha-256\n")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        server.options = (
            f"-c listen_addresses=127.0.0.1 -c port={port} -c ssl=on -c ssl_cert_file={server.folder}/server.crt"
            f" -c ssl_key_file={server.folder}/server.key -c fsync=off"
        )
        server.start()
        yield server, port


def certificate(server: ShopServer) -> None:
    """A certificate for localhost that is its own authority."""
    words = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"]
    words += ["-addext", "subjectAltName=DNS:localhost", "-keyout", "server.key", "-out", "server.crt"]
    account = as_server_account()
    subprocess.run([*account, *words], cwd=server.folder, check=True, capture_output=True)


@pytest.fixture
def lathe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in [name for name in os.environ if name.startswith("PG")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", str(tmp_path))
    record_runs(tmp_path / "lathe", 1)
    return tmp_path / "lathe"


def refused(lathe: Path, dsn: str) -> tuple[str, str]:
    with pytest.raises(SessionError) as error:
        ship(lathe, dsn)
    assert PASSWORD not in "".join([str(error.value), *getattr(error.value, "__notes__", [])])
    return error.value.problems[0].code, str(error.value)


def test_the_password_comes_from_the_usual_places_over_a_checked_line(
    guarded: tuple[ShopServer, int], lathe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, port = guarded
    authority = server.folder / "server.crt"
    dsn = f"host=localhost port={port} dbname=shop user={SHIPPER} sslmode=verify-full sslrootcert={authority}"
    code, said = refused(lathe, dsn)
    assert code == "ship.lost" and "password" in said
    monkeypatch.setenv("PGPASSWORD", "not it")
    assert "authentication failed" in refused(lathe, dsn)[1]
    monkeypatch.setenv("PGPASSWORD", PASSWORD)
    with connect_shop(dsn) as link:
        assert link.pgconn.ssl_in_use
    assert ship(lathe, dsn).rows["runs"] == 1
    monkeypatch.delenv("PGPASSWORD")
    record_runs(lathe, 1)
    passwords = tmp_path / "passwords"
    passwords.write_text(f"localhost:{port}:shop:{SHIPPER}:{PASSWORD}\n")
    passwords.chmod(0o600)
    monkeypatch.setenv("PGPASSFILE", str(passwords))
    services = tmp_path / "services.conf"
    services.write_text(
        f"[shop]\nhost=localhost\nport={port}\ndbname=shop\nuser={SHIPPER}\nsslmode=verify-full\n"
        f"sslrootcert={authority}\n"
    )
    monkeypatch.setenv("PGSERVICEFILE", str(services))
    assert ship(lathe, "service=shop").rows["runs"] == 1
    record_runs(lathe, 1)
    monkeypatch.setenv("PGSERVICE", "shop")
    assert ship(lathe, "").rows["runs"] == 1


def test_a_server_with_another_certificate_is_refused(
    guarded: tuple[ShopServer, int], lathe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PGPASSWORD", PASSWORD)
    other = tmp_path / "other.crt"
    words = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=other"]
    key = ["-keyout", str(tmp_path / "other.key"), "-out", str(other)]
    subprocess.run([*words, *key], check=True, capture_output=True)
    dsn = f"host=localhost port={guarded[1]} dbname=shop user={SHIPPER} sslmode=verify-full sslrootcert={other}"
    code, said = refused(lathe, dsn)
    assert code == "ship.lost" and "certificate" in said


def test_nothing_goes_over_a_network_in_the_clear_unless_that_is_what_was_said(
    guarded: tuple[ShopServer, int], lathe: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, port = guarded
    monkeypatch.setenv("PGPASSWORD", PASSWORD)
    server.stop()
    encrypted, server.options = server.options, server.options.replace("ssl=on", "ssl=off")
    server.start()
    try:
        # This address leads to this computer, too, and is none that says so.
        dsn = f"hostaddr=0.0.0.0 port={port} dbname=shop user={SHIPPER}"
        assert refused(lathe, dsn)[0] == "ship.not_encrypted"
        assert ship(lathe, f"{dsn} sslmode=disable").rows["runs"] == 1
    finally:
        server.stop()
        server.options = encrypted
        server.start()


@pytest.mark.parametrize(
    "dsn",
    [
        f"host=db user=lathe password='{PASSWORD}'",
        f"postgresql://lathe:{PASSWORD}@db/shop",
        f"postgresql://lathe@db/shop?password={PASSWORD}",
        f"host=db {PASSWORD}",
        f"host=db passwrod={PASSWORD}",
        f"postgresql://lathe:{PASSWORD}@db:port:port/shop",
    ],
)
def test_a_password_in_the_connection_string_is_refused_and_not_repeated(dsn: str, lathe: Path) -> None:
    assert refused(lathe, dsn)[0] in ("ship.password_given", "ship.not_an_address")
