"""What the workshop gets: the sheet for casting a design, and the files of its moulds."""
