"""Data gathering: what is sampled at servo rate, how it is packed, listed and read back, and a client for it."""
