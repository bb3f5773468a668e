"""Gains on trial: proposed, bounded, written, judged after a restart, and taken back."""
