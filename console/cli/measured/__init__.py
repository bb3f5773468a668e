"""Commands about measurements: a part, the chuck, the paper."""
