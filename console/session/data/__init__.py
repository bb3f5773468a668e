"""What the console keeps on the disk: run records, calibrations, learned compensations, stop records."""
