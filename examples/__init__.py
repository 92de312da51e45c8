"""Scripts that make what the examples ship."""
