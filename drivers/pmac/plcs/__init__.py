"""PLC programs: one scan after another, when they run, and the timers that they read."""
