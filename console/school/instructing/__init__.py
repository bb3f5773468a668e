"""The instructor at another terminal: commands to a simulated lathe, a view of the trainee's screen and log."""
