"""The instructor at another terminal: orders to a simulated lathe, and a look at the trainee's screen and log."""
