"""What is wanted: curves, targets, their pieces, and how far a shape is from them."""
