"""How a body is cast: what is cast in one piece, where it is split, how much silicone that takes."""
