"""Controller settings: read, compared, judged, and tested on the machine."""
