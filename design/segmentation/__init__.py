"""How a curve is split: the rod of few pieces of constant strain that explains its points best."""
