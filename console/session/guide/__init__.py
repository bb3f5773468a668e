"""The guide: the next step of the job with its key, and why a key does nothing now; for pages, commands, feed."""
