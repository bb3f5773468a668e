"""Job sequence with its interlocks and records; independent of screens and argument parser."""
