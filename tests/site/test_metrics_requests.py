"""Which requests `console metrics` answers, and for which Host."""

from __future__ import annotations

import pytest

from console.site.cli.metrics import response
from console.text.catalogue import load

TEXT = load("en")
HERE = "HTTP/1.1\r\nHost: 127.0.0.1:9301\r\n\r\n"


def status(request: str, *hosts: str) -> int:
    answer = response(request.encode("latin-1"), hosts, [], TEXT)
    head, _, body = answer.partition(b"\r\n\r\n")
    assert f"Content-Length: {len(body)}".encode() in head
    return int(answer.split(b" ", 2)[1])


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost:9301", "LOCALHOST", "[::1]:9301", "127.8.0.1:1"])
def test_requests_for_loopback_are_answered(host: str) -> None:
    assert status(f"GET /metrics HTTP/1.1\r\nHost: {host}\r\n\r\n") == 200


@pytest.mark.parametrize(
    "fields",
    [
        "Host: lathe.evil.example:9301\r\n",
        "Host: 192.168.1.7\r\n",
        "Host: localhost.evil.example\r\n",
        "Host: 127.0.0.1\r\nHost: evil.example\r\n",
        "Host: [::1\r\n",
        "Host:\r\n",
        "",
        "X: y\r\n" * 500,
    ],
)
def test_a_page_whose_name_was_led_to_this_computer_gets_nothing(fields: str) -> None:
    assert status(f"GET /metrics HTTP/1.1\r\n{fields}\r\n") == 421


def test_a_name_of_this_computer_that_was_given_is_answered() -> None:
    request = "GET /metrics HTTP/1.1\r\nHost: Lathe-3.shop:9301\r\n\r\n"
    assert (status(request), status(request, "lathe-3.shop")) == (421, 200)
    assert b"--host lathe-3.shop" in response(request.encode(), (), [], TEXT)


@pytest.mark.parametrize(
    ("line", "found"),
    [("GET /metrics?a=b", 200), ("GET /", 404), ("POST /metrics", 404), ("", 404), ("\xff", 404)],
)
def test_only_the_metrics_are_served(line: str, found: int) -> None:
    assert status(f"{line} {HERE}") == found
