"""Command line: one module per command, grouped by subject; shared modules are in this folder."""
