"""The pages on a recording."""
