"""PLC programs: scan by scan execution, scheduling, and their timers."""
