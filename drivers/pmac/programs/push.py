"""The tool's offset against the push of the cut: fed forward at the entry, and at the return from a feed hold.

The cut pushes the tool out by the force times the compliance of its loop, P72; the integrator takes it over, P74,
with the time constant of the loop, and goes on pushing once the tool is out of the part. So the path is offset by
what the integrator has not taken over yet, P72 P71 - P74, with P71 from 0 to 1 while the chip begins; after a hold
the program knows how far the integrator has relaxed meanwhile.

The chip begins late rather than early: what stands high is cut by the land of the turns that follow, what was cut
too deep stays.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.language.text import format_number
from drivers.pmac.programs.setup import APPROACH_MM, CutSetup
from profiles.job import Job

MOST_BLEND_TURNS, LEAST_BLEND_TURNS = 2.0, 0.5
TURNS_OF_LAND = 0.25  # fraction of the turns that cut a place in which the chip begins

_VALUES = """\
P72={push} ; push of the cut, counts
P73={relaxes} ; fraction of it that the integrator takes over in a segment
P76={step} ; blend of a segment
"""

_BEGIN = """\
P70=0 P71=0 P74=0 ; offset, fraction of the push in effect, what the integrator has taken over
P77={contact} ; segment of the feed at which the chip begins
"""

_RESUME = """\
P71=0
P74=P74*EXP((P52-P25-{{hold_in}})*{decays}) ; the integrator relaxes while the tool is out
P70=0-P74
"""


def _in_segment(fed: str, recut: tuple[str, str] | None) -> str:
    """Return the lines of a segment; `fed` are the segments of the feed so far.

    Of a part that was cut before, `recut`: the fraction of the push there, and the segment in which that ends.
    """
    whole = f"{fed}>P77 AND P71<0.999"
    if recut is not None:
        least, uncut = recut
        whole = f"{fed}>P77 AND P71<{least} OR {fed}>{uncut} AND P71<0.999"
    return f"IF({whole}) P71=P71+P76\nP74=P74+(P72*P71-P74)*P73\nP70=P72*P71-P74\n"


def blend_turns(setup: CutSetup) -> float:
    """Return the turns from the face of the part within which the push comes into effect."""
    return min(MOST_BLEND_TURNS, max(LEAST_BLEND_TURNS, TURNS_OF_LAND * setup.land_turns))


def _blend_step(setup: CutSetup, segments_a_turn: float) -> float:
    return 1.0 / max(1, round(blend_turns(setup) * segments_a_turn))


def with_push(text: str, job: Job, setup: CutSetup, push_um: float, segment_ms: float) -> str:
    """Return a template with the lines against a push of `push_um` before it relaxes; none where that is 0.

    It marks its places: `{push_values}`, `{push_begin}`, `{push_resume}`, `{push@FED}` in a segment, and
    `{pushed}` in a position of the tool.
    """
    turn_ms, number = 60_000.0 / job.spindle_speed_rpm, format_number
    decays = segment_ms / setup.relaxation_ms
    contact_turns, step = APPROACH_MM / job.feed_mm_per_rev, _blend_step(setup, turn_ms / segment_ms)
    values = {
        "push": number(push_um / setup.tool_count_um),
        "relaxes": number(-math.expm1(-decays)),
        "step": number(step),
        "contact": number(contact_turns * turn_ms / segment_ms),
        "decays": number(decays),
    }
    recut = None
    if setup.recut_turns:
        uncut = (contact_turns + setup.recut_turns) * turn_ms / segment_ms
        recut = number(max(setup.recut_depth - 0.5 * step, 0.0)), number(uncut)
    lines = {"push_values": _VALUES, "push_begin": _BEGIN, "push_resume": _RESUME}
    for name, piece in lines.items():
        text = text.replace(f"{{{name}}}", piece.format(**values) if push_um else "")
    for fed in ("P25-P24-P49", "P25-P49-P24", "(P25-P49)", "P25"):
        text = text.replace(f"{{push@{fed}}}", _in_segment(fed, recut) if push_um else "")
    return text.replace("{pushed}", "+P70" if push_um else "")


def left_of_push(setup: CutSetup, turn_ms: float, since_ms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the fraction of the push that moves the tool, by the time since the chip began: the program's offset.

    It comes into effect evenly over the blend, and the integrator takes it over.
    """
    blend_ms, t_ms = blend_turns(setup) * turn_ms, np.maximum(since_ms, 0.0)
    rising_ms, relaxes_ms = np.minimum(t_ms, blend_ms), setup.relaxation_ms
    if math.isinf(relaxes_ms):
        return rising_ms / blend_ms
    risen = -np.expm1(-rising_ms / relaxes_ms) * relaxes_ms / blend_ms
    return np.asarray(risen * np.exp(-(t_ms - rising_ms) / relaxes_ms), dtype=np.float64)
