"""What has happened: the alarms of a session with their times, and its log."""
