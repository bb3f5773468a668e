"""One cut, from the checks before it to the record behind it, for the screens and for `console run`."""
