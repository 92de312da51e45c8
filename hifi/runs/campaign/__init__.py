"""`pneunet campaign`: the data set that the rod law is trained on."""
