"""A recorded event to practise: the simulated lathe at the moment before it, and the fault that is like it."""
