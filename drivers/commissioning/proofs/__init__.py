"""Commissioning tests that move the machine, each with what it measured."""
