"""The wire format of the Ethernet board, with bytes as clients send them."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.ethernet import (
    Direction,
    MalformedRequestError,
    Request,
    RequestCode,
    buffer_length,
    line_length,
    take_request,
    write_reply,
)

DOWN, UP = Direction.DOWNLOAD, Direction.UPLOAD


def cut(chunks: list[bytes]) -> list[Request]:
    """The requests in a stream that comes in these segments; complete ones are taken at once."""
    waiting, found = bytearray(), []
    for chunk in chunks:
        waiting += chunk
        while True:
            request, used = take_request(waiting)
            if request is None:
                assert used == 0
                break
            found.append(request)
            del waiting[:used]
    assert not waiting
    return found


@pytest.mark.parametrize(
    ("sent", "request_"),
    [
        (
            bytes.fromhex("40bf00000000000d") + b"i6=1 i3=2 ver",
            Request(direction=DOWN, code=RequestCode.GETRESPONSE, length=13, data=b"i6=1 i3=2 ver"),
        ),
        (bytes.fromhex("c0c5000000000800"), Request(direction=UP, code=RequestCode.GETBUFFER, length=2048)),
        (bytes.fromhex("40b301f400000000"), Request(direction=DOWN, code=RequestCode.FLUSH, value=500)),
        (bytes.fromhex("c0c2000000000002"), Request(direction=UP, code=RequestCode.READREADY, length=2)),
        (
            bytes.fromhex("40ba040200010004") + b"\x10\0\0\0",
            Request(direction=DOWN, code=RequestCode.SETBIT, value=0x402, index=1, length=4, data=b"\x10\0\0\0"),
        ),
        (
            bytes.fromhex("c0b5000800000003") + b"abc",
            Request(direction=UP, code=RequestCode.SETMEM, value=8, length=3, data=b"abc"),
        ),
        (bytes.fromhex("c0e0000000000004"), Request(direction=UP, code=RequestCode.IPADDRESS, length=4)),
        (bytes.fromhex("40be0007004a0000"), Request(direction=DOWN, code=RequestCode.PORT, value=7, index=0x4A)),
    ],
)
def test_requests_of_clients_are_read_as_they_mean_them(sent: bytes, request_: Request) -> None:
    assert take_request(sent) == (request_, len(sent))
    assert request_.encode() == sent


def test_an_upload_carries_no_data_whatever_its_length_field_says() -> None:
    """Clients leave the field unset when they fetch: the next request follows at once."""
    sent = bytes.fromhex("c0b10000 00009999") + bytes.fromhex("c0c50000 0000ffff")
    assert [request.code for request in cut([sent])] == [RequestCode.GETLINE, RequestCode.GETBUFFER]


@pytest.mark.parametrize(
    ("length", "target"), [(0, 1400), (1, 1), (1399, 1399), (1400, 1400), (2048, 1400), (65_535, 1400)]
)
def test_a_reply_has_1400_bytes_unless_the_client_wants_fewer(length: int, target: int) -> None:
    assert Request(direction=UP, code=RequestCode.GETBUFFER, length=length).reply_length == target


@pytest.mark.parametrize("on_the_wire", ["0002", "0200"])
def test_a_control_character_may_stand_in_either_byte(on_the_wire: str) -> None:
    request, _ = take_request(bytes.fromhex(f"c0c4{on_the_wire}00000000"))
    assert request is not None
    assert request.control_character == 2


@pytest.mark.parametrize(
    "sent",
    [
        "00",
        "80b0",
        "c0b0",  # a line goes to the board
        "40c5",  # and a buffer comes from it
        "40aa",
        "4000",
        "40bf0000000005d5",  # 1493 bytes
        "40c6000000000401",  # 1025 bytes of lines
        "c0b4000000000579",  # 1401 bytes of memory
        "c0b4000000000000",  # and none
        "40b5000000000579",
        "c0b4ffff00000002",  # beyond the end of the memory
        "40bafffd00010004",
        "40ba000000010003",
        "40bb000000000004",
        "40e0000000000005",
        "c0c4004100000000",  # A is no control character
        "c0c4010200000000",
    ],
)
def test_what_is_no_request_is_told_as_soon_as_it_is_seen(sent: str) -> None:
    with pytest.raises(MalformedRequestError):
        take_request(bytes.fromhex(sent))


CARRYING = {
    RequestCode.SENDLINE: 1492,
    RequestCode.GETRESPONSE: 1492,
    RequestCode.WRITEBUFFER: 1024,
    RequestCode.FWDOWNLOAD: 1492,
}
BARE = (RequestCode.GETLINE, RequestCode.GETBUFFER, RequestCode.READREADY, RequestCode.WRITEERROR)
words = st.integers(0, 0xFFFF)


@st.composite
def requests(draw: st.DrawFn) -> Request:
    code = draw(st.sampled_from([*CARRYING, *BARE, RequestCode.SETMEM]))
    value, index = draw(words), draw(words)
    if code in BARE:
        return Request(direction=UP, code=code, value=value, index=index, length=draw(words))
    data = draw(st.binary(min_size=code == RequestCode.SETMEM, max_size=CARRYING.get(code, 1400)))
    place = min(value, 65_536 - len(data)) if code == RequestCode.SETMEM else value
    return Request(direction=DOWN, code=code, value=place, index=index, length=len(data), data=data)


@given(st.lists(requests(), max_size=6), st.data())
def test_any_segmentation_gives_the_same_requests(sent: list[Request], data: st.DataObject) -> None:
    stream = b"".join(request.encode() for request in sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12)))
    edges = [0, *cuts, len(stream)]
    assert cut([stream[a:b] for a, b in pairwise(edges)]) == sent


@given(st.lists(requests(), max_size=2))
def test_a_stream_that_comes_byte_by_byte_gives_the_same_requests(sent: list[Request]) -> None:
    stream = b"".join(request.encode() for request in sent)
    assert cut([bytes([byte]) for byte in stream]) == sent


@given(
    st.one_of(st.binary(max_size=60), st.binary(max_size=60).map(lambda tail: b"\x40\xbf\0\0\0\0\0\x02" + tail))
)
def test_garbage_is_refused_or_is_a_request_and_raises_nothing_else(garbage: bytes) -> None:
    waiting = bytearray(garbage)
    try:
        while waiting:
            request, used = take_request(waiting)
            if request is None:
                return
            assert request.encode() == bytes(waiting[:used])
            del waiting[:used]
    except MalformedRequestError:
        return


@pytest.mark.parametrize(
    ("waiting", "length"),
    [
        (b"", 0),
        (b"\x06", 1),
        (b"25\r50\r\x06P", 7),
        (b"25\r50\r", 0),
        (b"\x07ERR003\r\x06", 8),
        (b"1\r\x07ERR003\r5\r\x06", 10),
        (b"\x07ERR00", 0),
        (b"\x07\rERR003\r", 2),
        (b"\x07\nERR003\r", 9),
        (b"\x02data\r\x06", 6),
        (b"\n25\r\n", 1),
        (b"25\r\n", 4),
        (b"0\r" * 700, 1400),
        (b"0\r" * 699 + b"0\x06", 1400),
        (b"0\r" * 699 + b"00\x06", 1400),
    ],
)
def test_a_reply_ends_with_ack_or_lf_and_an_error_with_its_cr(waiting: bytes, length: int) -> None:
    assert buffer_length(waiting, 1400) == length


def test_fewer_bytes_than_the_reply_has_are_taken_from_its_beginning() -> None:
    assert buffer_length(b"123\r\x06", 3) == 3
    assert buffer_length(b"12", 3) == 0


@pytest.mark.parametrize(
    ("waiting", "length"), [(b"25\r50\r\x06", 3), (b"\x06", 1), (b"\n25\r", 1), (b"25", 0), (b"", 0)]
)
def test_a_line_ends_with_cr_ack_or_lf(waiting: bytes, length: int) -> None:
    assert line_length(waiting, 1400) == length


def test_the_result_of_a_write_has_the_line_with_its_low_byte_first_and_0x80_last() -> None:
    """Clients look for 0x80 in the last byte, for the ERR number before it, and read the first two as a number."""
    assert write_reply() == b"\0\0\0\0"
    assert write_reply(0x0102, 3) == b"\x02\x01\x03\x80"
