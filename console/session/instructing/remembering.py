"""Take down what the console knows of a lathe, and know it again."""

from __future__ import annotations

from dataclasses import replace

from console.session.instructing.knowledge import KEPT, Knowledge
from console.session.station.context import StationContext


def knowledge_of(context: StationContext, name: str) -> Knowledge:
    """Return what is known now."""
    commissioned = context.commissioned
    return Knowledge(
        name=name,
        at=context.local_time(),
        fields={each: getattr(context.state, each) for each in KEPT},
        plan=context.plan,
        started=context.started,
        limits_seen=context.limits_seen,
        fingerprint=None if commissioned is None else commissioned.fingerprint,
    )


def restore(context: StationContext, knowledge: Knowledge) -> None:
    """Know again what was known then; what ended meanwhile is over, and its record complete."""
    context.end_record()
    context.plan, context.started, context.limits_seen = knowledge.plan, knowledge.started, knowledge.limits_seen
    if context.commissioned is not None:
        context.commissioned.fingerprint = knowledge.fingerprint
    stop = context.state.stop
    if stop is not None:  # of what it ended, nothing is there any more
        stop = replace(stop, of_cut=False, mark_mm=None, tool_in_part=None, can_retract=False)
    # The last poll was of another lathe: what differs from it has not happened.
    context.tell(**knowledge.fields, snapshot=None, armed=None, stop=stop)
