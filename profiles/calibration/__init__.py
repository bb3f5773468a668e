"""What was measured at a chuck, and what follows from it: force by torque, stiffness by force and load."""
