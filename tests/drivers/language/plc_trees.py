"""Strategies for property tests: lines of a PLC, as the parser makes them."""

from __future__ import annotations

from hypothesis import strategies as st

from drivers.pmac.language.parser import HIGHEST_MOTOR
from drivers.pmac.language.plc_statements import HIGHEST_SYSTEM
from drivers.pmac.language.syntax import (
    Address,
    Assign,
    Else,
    EndIf,
    EndWhile,
    FurtherCondition,
    If,
    PlcStatement,
    PlcSwitch,
    While,
)
from tests.drivers.language.trees import conditions, expressions, messages, numbers, variables

addresses = st.builds(
    Address, st.none() | st.integers(1, HIGHEST_MOTOR), st.none() | st.integers(1, HIGHEST_SYSTEM)
).filter(lambda address: address != Address())
plc_statements: st.SearchStrategy[PlcStatement] = st.one_of(
    st.builds(If, conditions),
    st.builds(While, conditions),
    st.builds(FurtherCondition, st.sampled_from(["AND", "OR"]), conditions),
    st.sampled_from([Else(), EndIf(), EndWhile()]),
    st.builds(Assign, variables, expressions),
    st.builds(PlcSwitch, st.booleans(), numbers),
    messages,
    addresses,
)
plc_lines = st.lists(plc_statements, max_size=4).map(tuple)
