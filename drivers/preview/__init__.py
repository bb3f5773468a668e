"""What a cut will do, computed before anything is sent."""
