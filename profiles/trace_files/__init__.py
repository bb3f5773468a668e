"""The file formats of traces. Bytes in, columns and header out."""
