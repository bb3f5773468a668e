"""Lee & Lee (2001) recomputed: the paper's values, figure by figure, beside ours."""
