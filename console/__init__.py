"""The operator's side: command line, session and texts."""

WORDS = ("text", "school/words", "site/words")
"""Folders with the words of each language; those of a ring come and go with it."""
