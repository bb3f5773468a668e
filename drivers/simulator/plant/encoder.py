"""The scale of an axis: it counts, and what is between two counts nobody is told."""

from __future__ import annotations

from collections.abc import Callable

read_encoder: Callable[[float], int] = round
"""The reading for a true position, both in counts: the nearest whole one. A name for what Python has built in,
because it stands in the innermost loop of all."""
