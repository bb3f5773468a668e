"""One cut, from the checks before it to the record after it, for the screens and for `console run`."""
