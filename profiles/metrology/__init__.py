"""Metrology of roundness: reference circles, filters, harmonics, turns, V-blocks. Pure numbers."""
