"""The themes by outside measures: contrast after WCAG 2.1, and colours as dichromats see them."""

from __future__ import annotations

import itertools
import math

import pytest
from rich.color import Color
from rich.style import Style

from console.session.appearance import THEMES
from console.tui.application.themes import palette_named, theme_named
from console.tui.theme import Palette, Token

PAINTED = [name for name in THEMES if name != "16-colour"]


LEAST = {Token.RING: 2.0, **dict.fromkeys((Token.AXIS, Token.DIM, Token.STALE), 3.0)}
"""Contrast of frames and what needs no attention: 3 to 1 (WCAG 1.4.11), of the rings of a plot less; else 4.5."""

# G. M. Machado et al., A Physiologically-based Model for Simulation of Color Vision Deficiency, 2009; severity 1.
DEFICIENCIES = {
    "protanopia": (
        (0.152286, 1.052583, -0.204868),
        (0.114503, 0.786281, 0.099216),
        (-0.003882, -0.048116, 1.051998),
    ),
    "deuteranopia": (
        (0.367322, 0.860646, -0.227968),
        (0.280085, 0.672501, 0.047413),
        (-0.01182, 0.04294, 0.968881),
    ),
}


def linear(colour: Color) -> tuple[float, float, float]:
    triplet = colour.get_truecolor()
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
        for part in (each / 255.0 for each in triplet)
    )
    return red, green, blue


def luminance(colour: Color) -> float:
    red, green, blue = linear(colour)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(style: Style) -> float:
    assert style.color is not None and style.bgcolor is not None
    dark, light = sorted((luminance(style.color), luminance(style.bgcolor)))
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("name", PAINTED)
def test_every_token_can_be_read_on_its_background(name: str) -> None:
    factor = 7.0 / 4.5 if name == "contrast" else 1.0  # AAA in place of AA
    low = {
        token.name: round(contrast(style), 1)
        for token, style in palette_named(name).items()
        if contrast(style) < LEAST.get(token, 4.5) * (factor if token not in LEAST else 1.0)
    }
    assert low == {}


def as_seen(colour: Color, matrix: tuple[tuple[float, float, float], ...]) -> tuple[float, float, float]:
    """CIE L*a*b* of a colour as a dichromat sees it."""
    rgb = linear(colour)
    red, green, blue = (max(sum(m * c for m, c in zip(row, rgb, strict=True)), 0.0) for row in matrix)
    x = (0.4124 * red + 0.3576 * green + 0.1805 * blue) / 0.9505
    y = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    z = (0.0193 * red + 0.1192 * green + 0.9505 * blue) / 1.089
    fx, fy, fz = (t ** (1 / 3) if t > 0.008856 else 7.787 * t + 16 / 116 for t in (x, y, z))
    return 116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)


def colour_of(palette: Palette, token: Token) -> Color:
    style = palette[token]
    found = style.bgcolor if token in (Token.ALARM, Token.SIM) else style.color
    assert found is not None
    return found


def nearest(name: str) -> float:
    """The least difference (CIE 1976) of any two colours that mean something, to either kind of dichromat."""
    palette = palette_named(name)
    pairs = itertools.combinations((Token.ALARM, Token.WARNING, Token.ACTION, Token.SIM), 2)
    wanted = [*pairs, (Token.BEFORE, Token.AFTER)]
    return min(
        math.dist(*(as_seen(colour_of(palette, token), matrix) for token in pair))
        for pair in wanted
        for matrix in DEFICIENCIES.values()
    )


def test_the_colour_blind_safe_theme_keeps_its_colours_apart_for_dichromats() -> None:
    assert nearest("colour-blind") > 20.0
    assert nearest("colour-blind") > nearest("dark")


def test_sixteen_colours_are_those_of_the_terminal_on_its_own_background() -> None:
    for token, style in palette_named("16-colour").items():
        for colour in (style.color, style.bgcolor):
            assert colour is not None and (colour.is_default or (colour.number or 0) < 16), token
    assert theme_named("16-colour").ansi


@pytest.mark.parametrize("name", THEMES)
def test_every_token_has_a_style_and_blocks_stand_out(name: str) -> None:
    palette = palette_named(name)
    assert set(palette) == set(Token)
    text = palette[Token.TEXT]
    for token in (Token.SELECTED, Token.ALARM, Token.SIM, Token.STOP):
        assert palette[token].reverse or palette[token].bgcolor != text.bgcolor
