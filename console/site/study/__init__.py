"""Studies: a table of jobs, machines, plants, seeds and strategies, cut on the simulator without an operator."""
