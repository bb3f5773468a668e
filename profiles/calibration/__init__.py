"""Chuck calibration: force by torque, stiffness by force and load."""
