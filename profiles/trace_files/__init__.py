"""The kinds of files that a trace may come in. Bytes in, columns and header out."""
