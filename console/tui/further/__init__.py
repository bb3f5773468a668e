"""Pages without a digit, listed by the page More; one module each."""
