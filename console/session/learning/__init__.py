"""What a measured part teaches: the next compensation, judged and kept."""
