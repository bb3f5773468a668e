"""What the page Log shows: the entries of this session as lines, searched and exported."""
