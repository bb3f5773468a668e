"""Commands for the place of the console: its configuration and its data folder."""
