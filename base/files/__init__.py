"""Files: TOML, CSV, archives and records; whole or not there."""
