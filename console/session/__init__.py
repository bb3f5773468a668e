"""The sequence of a job, with its interlocks and records; knows no screen and no argument parser."""
