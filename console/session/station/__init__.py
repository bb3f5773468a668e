"""Session engine: owns the machine on its own thread, carries out commands and publishes the state."""
