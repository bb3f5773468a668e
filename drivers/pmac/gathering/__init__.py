"""Data gathering at servo rate: sources, packing, listing, reading back, and a client."""
