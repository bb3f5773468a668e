"""The command line: one module a command, by what it is about; what several commands share stands here."""
