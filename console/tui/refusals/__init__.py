"""Why a key of a page has no effect now: the answer to the key, and what the palette shows beside it."""
