"""The law of a rod's sections that was trained on finite elements."""
