"""The operator's side: command line, session and texts."""
