"""Commissioning tests that move the machine, each with its measurements."""
