"""Data that the console keeps on disk: run records, calibrations, learned compensations, stopping performance."""
