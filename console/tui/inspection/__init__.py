"""What the page Inspect shows: a part by any circle and filter, beside another part, and its spectrum."""
