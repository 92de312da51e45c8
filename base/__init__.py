"""The vocabulary every other package speaks: units, rod strains, SE(3), section frames, materials, files."""
