"""A simulated PMAC that controls a simulated lathe and workpiece."""
