"""What dolfinx needs: function spaces, materials, loads, surfaces, and measures of a deformed body."""
