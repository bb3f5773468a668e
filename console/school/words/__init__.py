"""Sentences of debrief and practice."""
