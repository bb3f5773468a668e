"""What the page Tune shows: the loop of the tool, its responses, its health tests, proposed gains."""
