"""The machine: child processes within limits, and what is said on the screen."""
