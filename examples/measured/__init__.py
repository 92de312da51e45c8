"""Public measurements of silicone bodies beside what is computed here: their numbers typed in, their sources,
and every assumption by name."""
