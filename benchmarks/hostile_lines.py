"""What another host of the controller sends, in `hostile_host`: lines that no cut asks for.

Each is meant for the worst: it changes what a cut is calculated with, holds it, ends it, or moves its zero.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Deed:
    """One deed: `first` is sent at once, `later` a few tenths of a second behind it, as of one who undoes it.

    `{program}` is the number of the program of the cut, `{tool}` that of the motor of the tool, `{gain}` its
    proportional gain, `{source}` and `{slew}` the time base of the coordinate system.
    """

    first: str
    later: str = ""

    @property
    def name(self) -> str:
        """How it is named in a table."""
        words = " ... ".join(each for each in (self.first, self.later) if each)
        return words.replace("\r", "; ")


_CONSTANTS = (
    "P11=P11+500",
    "P11=P11+40",
    "P12=P12*1.5",
    "P13=P13*1.001",
    "P14=P14+20",
    "P15=P15*2",
    "P16=P16*1.01",
    "P17=P17*0.5",
    "P18=P18*1.2",
    "P20=P20+2000",
    "P23=5",
    "P24=P24+60",
    "P28=P28+500",
    "P32=P32/2",
    "P35=P35+2000",
    "P83=P83*2",
    "P89=P89+20",
)
"""What the path of the tool is calculated with."""

_COUNTERS = (
    "P25=P25+40",
    "P25=P25-30",
    "P30=P30+3",
    "P31=P31+40",
    "P29=P29-1000",
    "P33=0",
    "P34=0",
    "P37=P37+400",
    "P59=2",
    "P79=P79+50",
    "P43=1 P44=1",
    "P23=5 P30=P23\rP43=P23 P44=1",
    "M26=1",
)
"""What a program counts with, and what it says of its end."""

_MOTION = (
    "&1H",
    "&1%0",
    "&1%50",
    "&1%120",
    "&1A",
    "&1Q",
    "&1/",
    "#1K",
    "#2K",
    "\x01",
    "\x0b",
    "#1HMZ",
    "#2HMZ",
    "#3HMZ",
    "#1J+",
    "#2J:200",
    "#3J/",
    "$$$",
)
"""Holds, overrides, ends, other zeros and jogs."""

_SETTINGS = (
    "I{tool}30={gain}/2",
    "I{tool}30={gain}*1.1",
    "I{tool}35=I{tool}35*0.5",
    "I{tool}11=0",
    "I{tool}14=0",
    "I{tool}69=1000",
    "I{slew}=1",
    "I{source}=0",
    "I51=0",
    "I51=1",
    "M169=M169+2000",
    "#{tool}DELETE COMP",
    "#{tool}DEFINE COMP 4,1000",
    "#{tool}DEFINE COMP 4.4,#2,#3,#{tool},10000,4000\r9 9 9 9",
    "P1000=777",
    "P1011=4321",
    "P1003=0",
    "DISABLE PLC 20",
    "#1->",
    "#1->2X",
)
"""Gains and limits, tables, the words of the console itself."""

_PROGRAMS = (
    "OPEN PROG {program} CLEAR\rX0 Z0\rCLOSE",
    "OPEN PROG {program}\rP44=1\rCLOSE",
    "DELETE PROG {program}",
    "OPEN PROG 77 CLEAR\rLINEAR TM500 X5000\rCLOSE\r&1B77R",
)

_MOMENTS = (
    Deed(first="P12=P12*2", later="P12=P12/2"),
    Deed(first="P11=P11+100", later="P11=P11-100"),
    Deed(first="P18=P18*3", later="P18=P18/3"),
    Deed(first="P28=P28+500", later="P28=P28-500"),
    Deed(first="I{tool}30={gain}/4", later="I{tool}30={gain}"),
    Deed(first="&1%10", later="&1%100"),
    Deed(first="&1H", later="&1R"),
    Deed(first="I51=0", later="I51=1"),
    Deed(first="M169=M169+1000", later="M169=M169-1000"),
)
"""Deeds that are undone before anybody may have asked."""

DEEDS = (
    *(Deed(first=line) for line in (*_CONSTANTS, *_COUNTERS, *_MOTION, *_SETTINGS, *_PROGRAMS)),
    *_MOMENTS,
)
