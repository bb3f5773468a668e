"""One thing has one name in Korean: what an operator has read once must not turn up under another word."""

from __future__ import annotations

import re

import pytest

from console.text.catalogue import words_of

GLOSSARY = {
    "lease": ("통신 감시", r"임대|리스"),
    "silent console": ("콘솔 응답이 끊길 때", r"조용"),
    "emergency stop": ("비상정지", r"비상\s+정지"),
    "spindle": ("스핀들", r"주축"),
    "drive": ("드라이브", r"구동"),
    "machine profile": ("기계 프로필", r"기계 파일|프로파일"),
    "part": ("공작물", r"부품"),
    "compensation table": ("보정표", r"테이블"),
    "carriage": ("왕복대", r"캐리지"),
    "gain": ("이득", r"게인"),
    "controller": ("제어기", r"카드|컨트롤러"),
    "enabling device": ("작동 허가 장치", r"허가 스위치"),
    "chuck key": ("척 렌치", r"척 키"),
}
"""The word of each thing, and the words that were or might be used beside it."""


def sentences() -> dict[str, str]:
    return dict(words_of("ko"))


@pytest.mark.parametrize("thing", GLOSSARY)
def test_one_thing_has_one_name(thing: str) -> None:
    name, others = GLOSSARY[thing]
    said = sentences()
    assert {key: s for key, s in said.items() if re.search(others, s)} == {}
    assert any(name in s for s in said.values())
