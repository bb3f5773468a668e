"""Commands that draw: the console itself, the keys of a terminal, the figures of the paper."""
