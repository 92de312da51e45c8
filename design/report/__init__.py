"""What a run shows: pictures, drawing, comparison, report."""
