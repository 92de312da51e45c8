"""The paper's analytic models in a consistent form."""
