"""What an agent is told: each change once, in the lines of the agent's protocol."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.__main__ import main
from console.session.errors import SessionError
from console.session.feed.feed_state import FeedAlarm, FeedState
from console.session.feed.observed_state import ObservedState
from console.session.feed.report import report
from console.session.station.state import Activity, StationState
from console.site.exchange.mtconnect import (
    ITEMS,
    NAMESPACE,
    PublishedState,
    devices_xml,
    is_news,
    messages,
    publish_state,
    shdr_lines,
)
from console.site.exchange.publisher import Broker, credentials
from profiles.store import load_machine
from tests.tui import scenes

MACHINE = load_machine("lee-2001-lathe").machine
CUTTING = replace(scenes.machine(Activity.CUTTING), cut=scenes.cut(), spindle_rpm=1000.3142)
AT = "2026-01-01T00:00:00.000Z"
DOCUMENT = Path(__file__).parents[3] / "docs" / "mtconnect.md"
NAME = f"{{{NAMESPACE}}}"

# The words of the standard for these events (MTConnect Part 3, controlled vocabularies).
EXECUTIONS = {"READY", "ACTIVE", "FEED_HOLD", "STOPPED", "UNAVAILABLE"}
MODES = {"AUTOMATIC", "MANUAL"}


def state(of: StationState, **more: Any) -> FeedState:
    observed = ObservedState(state=of, machine=MACHINE, now_s=of.at_s, **more)
    return report(observed, process=7, operator="kim", at_utc=AT)


def shown(of: StationState, **more: Any) -> PublishedState:
    return publish_state(state(of, **more), AT)


def tokens(line: str) -> list[str]:
    """Split a line as an agent does: quotes, backslashes, spaces around fields."""
    found: list[str] = []
    at = 0
    while at < len(line):
        while at < len(line) and line[at].isspace():
            at += 1
        if line[at : at + 1] == '"':
            at, token = at + 1, ""
            while at < len(line) and not (line[at] == '"' and line[at + 1 : at + 2] in ("", "|")):
                at += line[at] == "\\"
                token += line[at]
                at += 1
            at += 1
        else:
            end = line.find("|", at)
            end = len(line) if end < 0 else end
            token, at = line[at:end].rstrip(), end
        found.append(token)
        if line[at:] == "|":
            found.append("")
        at += 1
    return found


def test_a_new_agent_is_told_everything() -> None:
    lines = shdr_lines(shown(CUTTING, job="ring", parts=3), None)
    # 243827 counts from home, 41287 counts of 1 um, 10351 counts of 10000: as in the tests of the feed.
    radius_mm = MACHINE.tool.home_radius_mm - 243_827.0 / MACHINE.tool.counts_per_mm
    assert lines == [
        f"{AT}|avail|AVAILABLE|execution|ACTIVE|mode|AUTOMATIC|program|ring|part_count|3|spindle_rpm|1000.314"
        f"|spindle_deg|{10_351.0 / MACHINE.spindle.counts_per_rev * 360.0 % 360.0:.5f}"
        f"|tool_radius_mm|{radius_mm:.5f}|carriage_mm|{41_287.0 / MACHINE.carriage.counts_per_mm:.5f}",
        f"{AT}|communications|NORMAL||||",
        f"{AT}|motion|NORMAL||||",
        f"{AT}|system|NORMAL||||",
    ]


def test_afterwards_only_what_has_changed() -> None:
    before = shown(CUTTING, job="ring", parts=3)
    assert shdr_lines(before, before) == []
    after = shown(replace(CUTTING, spindle_rpm=999.0), job="ring", parts=4)
    assert shdr_lines(after, before) == [f"{AT}|part_count|4|spindle_rpm|999.000"]


def test_without_a_console_everything_is_unavailable() -> None:
    gone = publish_state(None, AT)
    (values, *conditions) = shdr_lines(gone, shown(CUTTING))
    changed = tokens(values)[1:]
    assert set(changed[1::2]) == {"UNAVAILABLE"}
    # No job was open: `program` was unavailable before.
    assert set(changed[0::2]) == {item.key for item in ITEMS} - {"program"}
    assert conditions == [f"{AT}|{key}|UNAVAILABLE||||" for key in ("communications", "motion", "system")]
    assert shdr_lines(gone, gone) == []


def test_a_lost_link_leaves_the_alarm_about_it_and_no_old_positions() -> None:
    lost = shown(replace(CUTTING, activity=Activity.LOST), job="ring")
    assert (lost.values["avail"], lost.values["execution"], lost.values["program"]) == (
        "UNAVAILABLE",
        "UNAVAILABLE",
        "ring",
    )
    assert {lost.values[key] for key in ("spindle_rpm", "tool_radius_mm", "carriage_mm")} == {"UNAVAILABLE"}
    assert lost.conditions is not None


def test_old_values_are_not_told_as_current() -> None:
    old = publish_state(replace(state(CUTTING), stale=True), AT)
    assert {old.values[item.key] for item in ITEMS if item.units} == {"UNAVAILABLE"}
    assert old.values["execution"] == "ACTIVE"


def alarm(code: str, priority: str, text: str, kind: str = "new") -> FeedAlarm:
    return FeedAlarm(number=1, code=code, priority=priority, state=kind, text=text)


def with_alarms(*alarms: FeedAlarm) -> PublishedState:
    return publish_state(replace(state(CUTTING), alarms=alarms), AT)


def test_alarms_are_conditions_with_their_codes() -> None:
    normal, amplifier = with_alarms(), alarm("machine.fault", "high", "tool: amplifier fault")
    one = with_alarms(amplifier)
    assert shdr_lines(one, normal) == [f"{AT}|system|FAULT|machine.fault|high||tool: amplifier fault"]
    both = with_alarms(amplifier, alarm("record.lost", "low", "disk full"), alarm("link.lost", "high", "cable"))
    assert shdr_lines(both, one) == [
        f"{AT}|communications|FAULT|link.lost|high||cable",
        f"{AT}|system|WARNING|record.lost|low||disk full",
    ]
    # One of two is over: its code alone is normal. The last is over: all is normal, and no code is named.
    over = with_alarms(
        replace(amplifier, state="returned"), alarm("record.lost", "low", "disk full", "acknowledged")
    )
    assert shdr_lines(over, both) == [f"{AT}|communications|NORMAL||||", f"{AT}|system|NORMAL|machine.fault|||"]
    assert shdr_lines(normal, over) == [f"{AT}|system|NORMAL||||"]


def test_two_alarms_of_one_code_are_one_condition() -> None:
    (line,) = shdr_lines(
        with_alarms(alarm("machine.fault", "medium", "tool"), alarm("machine.fault", "high", "spindle")),
        with_alarms(),
    )
    assert line == f"{AT}|system|FAULT|machine.fault|high||tool / spindle"


def test_an_agent_that_comes_later_hears_the_alarms_that_stand() -> None:
    lines = shdr_lines(with_alarms(alarm("cut.out_of_phase", "medium", "12 deg")), None)
    assert lines[2:4] == [f"{AT}|motion|NORMAL||||", f"{AT}|motion|WARNING|cut.out_of_phase|medium||12 deg"]


@given(st.text(alphabet=st.characters(exclude_categories=["Cs"]), max_size=20))
def test_any_name_of_a_job_reaches_the_agent(job: str) -> None:
    values = publish_state(replace(state(CUTTING), job=job), AT)
    (line, *_) = shdr_lines(values, None)
    found = tokens(line)
    assert "\n" not in line
    assert found[found.index("program") + 1 : found.index("part_count")] == [" ".join(job.split())]


@pytest.mark.parametrize("text", ["a|b", '"', 'a"|"b', "\\|", '"\\', "가|공"])
def test_bars_and_quotes_in_a_text_stay_in_it(text: str) -> None:
    (line,) = shdr_lines(with_alarms(alarm("machine.fault", "high", text)), with_alarms())
    assert tokens(line) == [AT, "system", "FAULT", "machine.fault", "high", "", text]


@pytest.mark.parametrize("activity", list(Activity))
def test_every_word_is_one_of_the_standard(activity: Activity) -> None:
    values = shown(scenes.machine(activity)).values
    assert values["execution"] in EXECUTIONS and values["mode"] in MODES
    assert values["avail"] in {"AVAILABLE", "UNAVAILABLE"}


def data_items(document: str) -> list[Xml.Element]:
    return list(Xml.fromstring(document).iter(f"{NAME}DataItem"))


def test_the_description_has_every_key_that_is_sent() -> None:
    sent = {key for line in shdr_lines(shown(CUTTING), None) for key in tokens(line)[1:2]}
    sent |= {item.key for item in ITEMS}
    assert {each.get("name") for each in data_items(devices_xml("lathe-3", False, "ab12"))} == sent | {"avail"} - {
        None
    }


def test_the_description_keeps_the_rules_of_its_schema() -> None:
    """Those of MTConnectDevices 1.7: order of elements, required attributes, ids that are unique."""
    root = Xml.fromstring(devices_xml("lathe 3 <&> 선반", False, "ab12"))
    assert [child.tag for child in root] == [f"{NAME}Header", f"{NAME}Devices"]
    header = {"creationTime", "sender", "instanceId", "version", "bufferSize", "assetBufferSize", "assetCount"}
    assert set(root[0].attrib) == header
    ids = [each.attrib["id"] for each in root.iter() if "id" in each.attrib]
    assert len(ids) == len(set(ids)) and all(each.replace(".", "").replace("-", "").isidentifier() for each in ids)
    (device,) = root[1]
    assert device.attrib["name"] == "lathe 3 <&> 선반" and {"id", "name", "uuid"} <= set(device.attrib)
    order = ["Description", "Configuration", "DataItems", "Components"]
    for component in root[1].iter():
        kinds = [child.tag.removeprefix(NAME) for child in component]
        if "DataItems" in kinds or "Components" in kinds:
            assert kinds == sorted(kinds, key=order.index)
    for item in data_items(devices_xml("lathe-3", False, "ab12")):
        assert {"id", "category", "type"} <= set(item.attrib)
        assert (item.get("category") == "SAMPLE") == ("units" in item.attrib)


def test_the_words_of_the_description_are_those_of_the_model_of_the_standard() -> None:
    model = pytest.importorskip("pymtconnect", reason="pymtconnect, the model of the standard, is not installed")
    types = {
        "EVENT": {each.value for each in model.EventEnum},
        "SAMPLE": {each.value for each in model.SampleEnum},
        "CONDITION": {each.value for each in model.ConditionEnum},
    }
    units = {each.value.replace("_PER_", "/") for each in model.UnitEnum}
    sub_types = {each.value for each in model.DataItemSubTypeEnum}
    for item in data_items(devices_xml("lathe-3", False, "ab12")):
        assert item.attrib["type"] in types[item.attrib["category"]]
        assert item.get("units", "COUNT") in units
        assert item.get("subType", "ACTUAL") in sub_types


def test_the_simulated_device_cannot_be_taken_for_the_real_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mtconnect", "--devices", "--machine", "turbo-ethernet-lathe", "--sim"]) == 0
    simulated = capsys.readouterr().out
    assert 'name="turbo-ethernet-lathe-SIM"' in simulated and "SIMULATED" in simulated
    assert main(["mtconnect", "--devices", "--machine", "turbo-ethernet-lathe"]) == 0
    real = capsys.readouterr().out
    assert "SIM" not in real
    ids = [{item.get("id") for item in data_items(each)} for each in (simulated, real)]
    assert not ids[0] & ids[1]


def test_every_data_item_is_documented() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    for item in data_items(devices_xml("lathe-3", False, "ab12")):
        assert f"| `{item.get('name')}` | {item.get('type')}" in text


# What is published by topic, in which order, and who may read the password.


def state_mqtt(**more: Any) -> FeedState:
    of = scenes.machine(Activity.READY)
    observed = ObservedState(state=of, machine=load_machine("lee-2001-lathe").machine, now_s=of.at_s)
    return replace(report(observed, process=7, operator="kim", at_utc=AT), **more)


def test_available_comes_last_and_unavailable_first() -> None:
    assert list(messages(publish_state(state_mqtt(), AT), state_mqtt()))[-1] == "avail"
    assert next(iter(messages(publish_state(None, AT), None))) == "avail"


def test_alarms_are_told_with_their_level() -> None:
    alarm = FeedAlarm(number=1, code="record.lost", priority="low", state="new", text="disk full")
    one = messages(publish_state(state_mqtt(alarms=(alarm,)), AT), state_mqtt())
    told = {"level": "WARNING", "code": "record.lost", "priority": "low", "text": "disk full"}
    assert json.loads(one["system"]) == {"level": "WARNING", "active": [told]}
    assert json.loads(one["motion"]) == {"level": "NORMAL", "active": []}
    gone = messages(publish_state(None, AT), None)
    assert json.loads(gone["system"]) == {"level": "UNAVAILABLE", "active": []}
    assert gone["state"] == b""


def test_a_state_is_news_when_more_than_time_has_passed() -> None:
    assert not is_news(state_mqtt(at_utc="2026-01-01T00:00:01.000Z", age_s=0.1), state_mqtt())
    assert (
        is_news(state_mqtt(parts=1), state_mqtt()) and is_news(None, state_mqtt()) and is_news(state_mqtt(), None)
    )


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
