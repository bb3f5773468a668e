"""Fault injection for the simulated machine: its lines, its motors and its controller."""
