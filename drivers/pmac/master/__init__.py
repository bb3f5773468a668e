"""Motion driven by a master encoder: its converted position, external time base, position following."""
