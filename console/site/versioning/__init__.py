"""The data folder as a clone of a git repository: what differs from its commit, and what a cut was made from."""
