"""Execute a motion program: from statements to requests for motion, one at a time."""
