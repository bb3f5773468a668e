"""Analyse a motion program: its actual motion move by move, and its problems."""
