"""Commands of the school: lessons, tries, instruct."""
