"""On-line commands by topic: each module has a table of its words and their functions."""
