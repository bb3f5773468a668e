"""From moves to positions over time: the rules of TA, TS, TM, F, PVT and jogs, in one place."""
