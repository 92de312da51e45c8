"""`pneunet train`: the law from a data set, and how well it does."""
