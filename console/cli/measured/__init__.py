"""Commands about what was measured: a part, the chuck, the paper."""
