"""Learning from measured parts: derive, judge and keep the next compensation."""
