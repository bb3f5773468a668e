"""Compensation paths: computed, learned from parts, kept within bounds."""
