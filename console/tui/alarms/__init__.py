"""What the page Alarms shows: the alarms of this session, and its log."""
