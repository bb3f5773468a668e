"""The machine side: links, the controller's language and rules, the lathe built on them, and a simulator."""

WORDS = ("words",)
"""Folders with the words of each language."""
