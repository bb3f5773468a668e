"""What a controller is set to: read, kept in a file, compared, judged, and the little of it that is written."""
