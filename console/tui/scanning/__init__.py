"""A code that was scanned: its characters come at once, as if typed; a job opens, and nothing else."""
