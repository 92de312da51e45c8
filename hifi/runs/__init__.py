"""Runs that write files: cases in processes of their own, solve, study, campaign."""
