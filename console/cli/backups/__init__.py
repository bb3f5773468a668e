"""Backups of a controller from the command line: how far they are, and sent back."""
