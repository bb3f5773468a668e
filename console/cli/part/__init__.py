"""Commands about a part that is still to be cut: its prediction, and its program."""
