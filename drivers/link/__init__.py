"""Transports that carry bytes between the console and a controller."""
