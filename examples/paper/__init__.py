"""The figures of Jiang et al., Appl. Phys. Rev. 8, 041416 (2021), made with pneunet: `python -m
examples.paper`."""
