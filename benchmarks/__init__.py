"""Every figure the project quotes, measured: `make bench` or `make bench ONLY=part`."""
