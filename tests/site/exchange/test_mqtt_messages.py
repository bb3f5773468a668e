"""What is published by topic, in which order, and who may read the password."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from console.__main__ import main
from console.session.errors import SessionError
from console.session.feed.feed_state import FeedAlarm, FeedState
from console.session.feed.observed import Observed
from console.session.feed.report import report
from console.session.station.state import Activity
from console.site.exchange.broker import Broker, credentials
from console.site.exchange.mtconnect import is_news, messages, published
from profiles.store import load_machine
from tests.tui import scenes

AT = "2026-01-01T00:00:00.000Z"


def state(**more: Any) -> FeedState:
    of = scenes.machine(Activity.READY)
    observed = Observed(state=of, machine=load_machine("lee-2001-lathe").machine, now_s=of.at_s)
    return replace(report(observed, process=7, operator="kim", at_utc=AT), **more)


def test_available_comes_last_and_unavailable_first() -> None:
    assert list(messages(published(state(), AT), state()))[-1] == "avail"
    assert next(iter(messages(published(None, AT), None))) == "avail"


def test_alarms_are_told_with_their_level() -> None:
    alarm = FeedAlarm(number=1, code="record.lost", priority="low", state="new", text="disk full")
    one = messages(published(state(alarms=(alarm,)), AT), state())
    told = {"level": "WARNING", "code": "record.lost", "priority": "low", "text": "disk full"}
    assert json.loads(one["system"]) == {"level": "WARNING", "active": [told]}
    assert json.loads(one["motion"]) == {"level": "NORMAL", "active": []}
    gone = messages(published(None, AT), None)
    assert json.loads(gone["system"]) == {"level": "UNAVAILABLE", "active": []}
    assert gone["state"] == b""


def test_a_state_is_news_when_more_than_time_has_passed() -> None:
    assert not is_news(state(at_utc="2026-01-01T00:00:01.000Z", age_s=0.1), state())
    assert is_news(state(parts=1), state()) and is_news(None, state()) and is_news(state(), None)


def test_a_password_comes_from_a_file_of_its_owner_or_from_the_environment(tmp_path: Path) -> None:
    environment = {"TRILOBE_MQTT_USER": "lathe", "TRILOBE_MQTT_PASSWORD": "p"}
    assert credentials(environment, None) == ("lathe", "p")
    assert credentials({}, None) == (None, None)
    file = tmp_path / "secret"
    file.write_text("kim\nword with spaces\n")
    file.chmod(0o640)
    with pytest.raises(SessionError, match="chmod 600"):
        credentials(environment, file)
    file.chmod(0o600)
    assert credentials(environment, file) == ("kim", "word with spaces")
    for wrong in (b"", b"only one line\n", b"a\nb\nc\n", b"\n\n"):
        file.write_bytes(wrong)
        with pytest.raises(SessionError, match="two lines"):
            credentials(environment, file)
    file.write_bytes(b"\xff\nsecret-word\n")
    with pytest.raises(SessionError) as refused:
        credentials(environment, file)
    assert "secret-word" not in str(refused.value)


def test_the_text_of_a_broker_has_no_password() -> None:
    broker = Broker(host="b", port=8883, tls=True, user="lathe", password="hunter2")
    assert str(broker) == "mqtts://b:8883"
    assert "hunter2" not in repr(broker)


def test_without_its_package_the_command_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "paho.mqtt.client", None)
    assert main(["mqtt", "--broker", "127.0.0.1", "--data", str(tmp_path)]) == 1
    assert "trilobe[mqtt]" in capsys.readouterr().err
