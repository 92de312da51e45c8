"""`pneunet solve`: one manipulator, with tables, fields and checkpoints."""
