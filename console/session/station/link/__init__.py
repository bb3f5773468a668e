"""The link of a station beside its machine: lost and opened again, and who else is at it."""
