"""Lee & Lee (2001) recomputed: what the paper says, figure by figure, beside what comes out here."""
