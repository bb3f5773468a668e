"""What the page Calibrate shows and enters: calibrations that are kept, and measured points that are not yet."""
