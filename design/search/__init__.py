"""The search for a design: space, first guess, least squares, whole chambers."""
