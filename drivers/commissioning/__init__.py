"""What a controller is set to: read, compared, judged, tested on the machine."""
