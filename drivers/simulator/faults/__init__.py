"""Faults on demand for the simulated machine: of its lines, of its motors and of the card."""
