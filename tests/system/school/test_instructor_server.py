"""The address of an instructor: only the token opens it, and nobody at it holds up anybody else."""

from __future__ import annotations

import socket
import stat
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from console.__main__ import main
from console.school.instructing.client import Instructor
from console.school.instructing.dispatcher import CarryOut, Dispatcher
from console.school.instructing.mailbox import Mailbox
from console.school.instructing.order import LONGEST_LINE, OrderReply
from console.school.instructing.server import MOST_CLIENTS, InstructorServer
from console.school.instructing.token import forget_token, keep_token, kept_token, new_token, token_path
from console.session.errors import SessionError
from console.session.station.commands import Command
from drivers.errors import LinkError
from drivers.simulator.hosts.control_address import UnixAddress, parse_control_address

pytestmark = [pytest.mark.system, pytest.mark.timeout(60)]

TOKEN = "a-token"


class Machine:
    """Answers every order with its own line; notes what was ordered."""

    def __init__(self) -> None:
        self.ordered: list[str] = []
        self.connected = True

    def post(self, intent: Command) -> bool:
        if self.connected:
            assert isinstance(intent, CarryOut)
            self.ordered.append(intent.order.line)
            intent.answered(OrderReply(lines=(intent.order.line,)))
        return self.connected


@pytest.fixture
def machine() -> Machine:
    return Machine()


@pytest.fixture
def address(machine: Machine, tmp_path: Path) -> Iterator[UnixAddress]:
    place = UnixAddress(path=str(tmp_path / "socket"))
    server = InstructorServer(place, TOKEN, Dispatcher(Mailbox(), machine.post, lambda: 0.0))
    server.start()
    yield place
    server.close()
    assert not Path(place.path).exists()


def raw(address: UnixAddress) -> socket.socket:
    link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    link.settimeout(20.0)
    link.connect(address.path)
    return link


def is_closed(link: socket.socket) -> bool:
    try:
        while link.recv(65_536):
            pass
    except ConnectionError:
        pass
    return True


def test_an_order_is_answered(address: UnixAddress, machine: Machine) -> None:
    with Instructor(address, TOKEN, stays=False) as instructor:
        assert instructor.ask("active").lines == ("active",)
        refused = instructor.ask("dance").problem
        assert refused is not None
        assert refused.code == "instruct.unknown"
        machine.connected = False
        early = instructor.ask("active").problem
        assert early is not None
        assert early.code == "instruct.not_ready"
    assert machine.ordered == ["active"]


@pytest.mark.parametrize("token", ["", "a-toke", "a-token2", "한글"])
def test_a_wrong_token_is_refused_and_orders_nothing(token: str, address: UnixAddress, machine: Machine) -> None:
    with pytest.raises(SessionError, match="wrong token"):
        Instructor(address, token, stays=False)
    with raw(address) as link:
        link.sendall(f"once {token}\nclear\n".encode())
        assert is_closed(link)
    assert machine.ordered == []


def instruct(capsys: pytest.CaptureFixture[str], address: UnixAddress, *words: str) -> tuple[int, str, str]:
    capsys.readouterr()
    code = main(["instruct", f"unix:{address.path}", *words, "--data", str(Path(address.path).parent)])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_a_token_comes_from_a_file_or_from_the_environment(
    address: UnixAddress, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "copy"
    file.write_text(f"{TOKEN}\n", encoding="ascii")
    assert instruct(capsys, address, "active", "--token-file", str(file)) == (0, "active\n", "")
    monkeypatch.setenv("TRILOBE_INSTRUCT_TOKEN", TOKEN)
    assert instruct(capsys, address, "active") == (0, "active\n", "")
    monkeypatch.setenv("TRILOBE_INSTRUCT_TOKEN", "another")
    assert instruct(capsys, address, "active")[0] == 1
    assert instruct(capsys, address, "active", "--token-file", str(file))[0] == 0, "what is stated here counts"


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("words", [("--token", TOKEN), (f"--token={TOKEN}",)])
def test_a_token_in_the_command_line_is_refused_with_what_to_do(
    address: UnixAddress,
    machine: Machine,
    words: tuple[str, ...],
    language: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, out, err = instruct(capsys, address, "active", *words, "--lang", language)
    assert (code, out, machine.ordered) == (2, "", [])
    assert "--token-file FILE" in err and "TRILOBE_INSTRUCT_TOKEN" in err and TOKEN not in err


def test_the_socket_is_its_owners(address: UnixAddress) -> None:
    assert stat.S_IMODE(Path(address.path).stat().st_mode) == 0o600


@pytest.mark.parametrize("sent", [b"x" * 100_000, b"\xff\xfe\n", b"once\n", b"stay  a-token\n"])
def test_a_client_that_is_no_instructor_is_dropped(sent: bytes, address: UnixAddress, machine: Machine) -> None:
    with raw(address) as link:
        try:
            link.sendall(sent)
        except ConnectionError:
            return
        assert is_closed(link)
    assert machine.ordered == []


def test_an_endless_line_is_dropped_and_the_next_client_is_served(address: UnixAddress) -> None:
    with raw(address) as link:
        link.sendall(f"once {TOKEN}\n".encode())
        assert link.recv(1000)
        try:
            for _ in range(100):
                link.sendall(b"y" * LONGEST_LINE)
        except ConnectionError:
            pass
        assert is_closed(link)
    with Instructor(address, TOKEN, stays=False) as instructor:
        assert instructor.ask("list").problem is None


def test_silent_clients_take_no_place_for_ever(address: UnixAddress) -> None:
    """Those without a token are dropped after some seconds; more than fit are dropped at once."""
    with ExitStack() as opened:
        silent = [opened.enter_context(raw(address)) for _ in range(MOST_CLIENTS)]
        assert is_closed(opened.enter_context(raw(address)))
        for link in silent:
            assert is_closed(link)
    with Instructor(address, TOKEN, stays=False) as instructor:
        assert instructor.ask("list").problem is None


def test_a_pause_ends_with_the_terminal_that_made_it(address: UnixAddress, machine: Machine) -> None:
    with Instructor(address, TOKEN, stays=False) as once:
        once.ask("pause")
    with Instructor(address, TOKEN, stays=True) as stays:
        stays.ask("pause")
    until_s = time.monotonic() + 10.0
    while len(machine.ordered) < 3 and time.monotonic() < until_s:
        time.sleep(0.01)
    assert machine.ordered == ["pause", "pause", "resume"]


def test_an_address_that_is_taken_is_refused(address: UnixAddress) -> None:
    with pytest.raises(LinkError, match="socket"):
        InstructorServer(address, TOKEN, Dispatcher(Mailbox(), lambda intent: False, lambda: 0.0)).start()
    any_port, nobody = parse_control_address("tcp:127.0.0.1:0"), Dispatcher(Mailbox(), lambda _: False, float)
    port = InstructorServer(any_port, TOKEN, nobody)
    bound = parse_control_address(port.start())
    with pytest.raises(LinkError, match=r"127\.0\.0\.1"):
        InstructorServer(bound, TOKEN, Dispatcher(Mailbox(), lambda intent: False, lambda: 0.0)).start()
    port.close()


def test_a_token_is_kept_for_its_owner_and_forgotten(tmp_path: Path) -> None:
    path, token = token_path(tmp_path, parse_control_address("tcp:localhost:5000")), new_token()
    assert path == token_path(tmp_path, parse_control_address("tcp:127.0.0.1:5000"))
    keep_token(path, "another")
    keep_token(path, token)
    assert kept_token(path) == token
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    forget_token(path, "another")
    assert path.exists()
    forget_token(path, token)
    assert not path.exists()
