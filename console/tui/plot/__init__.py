"""Plots in cells: axes by plotext, data as braille dots, widgets that send only what changed."""
