"""`pneunet study`: bodies over a grid or a list."""
