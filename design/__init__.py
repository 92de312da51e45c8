"""What is wanted: a target curve in, a manipulator that follows it out, and the pictures and report that
judge it."""
