"""Draw what the README begins with: a part cut plainly and one cut with compensation, as they were measured.

python -m docs.before_after

Both are cut by the program, on a simulated lathe with friction, noise and cutting force, and the picture says so.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from docs.pictures import BACKGROUND, FOREGROUND
from profiles.roundness import evaluate, profile_of
from profiles.traces import Trace, read_trace

PICTURE = Path(__file__).with_name("pictures") / "before-after.svg"
RUN = "lee-2001-experiment-1 --sim --plant steady --seed 7 --strategy cam --learn 1".split()
FILTER_UPR = 50.0
FONTS = "system-ui,'DejaVu Sans','Noto Sans',Arial,sans-serif"
WIDTH, HEIGHT = 760, 420
RADIUS, PX_PER_UM = 112.0, 1.1
POINTS = 360
GREY, ORANGE, CYAN, PINK = "#8a8f94", "#ffaf5f", "#5fd7d7", "#d75fd7"


@dataclass(frozen=True, slots=True)
class Part:
    """A measured part: its title, its trace and its colour."""

    title: str
    trace: Trace
    colour: str

    @property
    def ront_um(self) -> float:
        """Roundness by the least squares circle."""
        return evaluate(self.trace.angle_deg, self.trace.deviation_um, FILTER_UPR).ront_um


def parts_of(folder: Path) -> tuple[Part, Part]:
    """Cut, measure and export; return the part without compensation and the first one with it.

    Raises:
        CalledProcessError: the command refused.
        ValueError: it left other traces than expected.
    """
    data, exported = folder / "data", folder / "exported"
    for words in (("run", *RUN), ("records", "export", str(exported), "--traces")):
        command = [sys.executable, "-m", "console", *words, "--data", str(data)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    (before,) = exported.glob("*-before.trace.csv")
    (after,) = exported.glob("*-part-1.trace.csv")
    return Part("before", read_trace(before), ORANGE), Part("after", read_trace(after), CYAN)


def picture(before: Part, after: Part) -> str:
    """Return both parts side by side at one magnification, as the text of an SVG file that needs nothing else."""
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}"'
            f' height="{HEIGHT}" font-family="{FONTS}" font-size="15" text-anchor="middle">',
            f'<rect width="{WIDTH}" height="{HEIGHT}" rx="6" fill="{BACKGROUND}"/>',
            *_disc(before, WIDTH / 4, "plain cut"),
            *_disc(after, 3 * WIDTH / 4, "with compensation, learned in air and in the cut"),
            f'<rect x="20" y="18" width="104" height="24" fill="{PINK}"/>',
            f'<text x="72" y="35" font-weight="bold" fill="{BACKGROUND}">SIMULATED</text>',
            _text(WIDTH / 2, HEIGHT - 38, f"errors drawn {_magnification():.0f} times, same scale", GREY),
            _text(WIDTH / 2, HEIGHT - 16, "RONt, LSC, 1-50 UPR, free; first part; plant steady, seed 7", GREY),
            "</svg>\n",
        )
    )


def _magnification() -> float:
    """How much larger a deviation is drawn than the part: its radius of 25.9 mm is that of the circle."""
    return PX_PER_UM * 25900.0 / RADIUS


def _disc(part: Part, x: float, how: str) -> Iterator[str]:
    y = 200.0
    yield f'<circle cx="{x:g}" cy="{y:g}" r="{RADIUS:g}" fill="none" stroke="{GREY}" stroke-dasharray="2 5"/>'
    ink = f'fill="{part.colour}"'
    yield f'<path {ink} fill-opacity="0.12" stroke="{part.colour}" stroke-width="2" d="{_outline(part, x, y)}"/>'
    size = 'font-size="32" font-weight="bold"'
    yield f'<text x="{x:g}" y="{y + 4:g}" {size} {ink}>{part.ront_um:.1f} um</text>'
    yield _text(x, y + 28, part.title, FOREGROUND)
    yield _text(x, 350, how, FOREGROUND)


def _text(x: float, y: float, text: str, colour: str) -> str:
    return f'<text x="{x:g}" y="{y:g}" fill="{colour}">{text}</text>'


def _outline(part: Part, x: float, y: float) -> str:
    angles, deviations = profile_of(part.trace.angle_deg, part.trace.deviation_um, FILTER_UPR)
    step = max(len(angles) // POINTS, 1)
    points = []
    for angle_deg, deviation_um in zip(angles[::step], deviations[::step], strict=True):
        radius, angle = RADIUS + PX_PER_UM * deviation_um, math.radians(angle_deg)
        points.append(f"{x + radius * math.sin(angle):.1f} {y - radius * math.cos(angle):.1f}")
    return "M" + "L".join(points) + "z"


def main(arguments: Sequence[str]) -> None:
    """Draw the picture, to the file given or that of the documentation."""
    path = Path(arguments[0]) if arguments else PICTURE
    with tempfile.TemporaryDirectory() as folder:
        path.write_text(picture(*parts_of(Path(folder))), encoding="utf-8")
    print(f"written: {path.name}")


if __name__ == "__main__":
    main(sys.argv[1:])
