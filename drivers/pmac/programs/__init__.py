"""Motion programs that make a cut."""
