"""Commands about a part that is still to be cut: what is to come of it, and its program."""
