"""A whole body: the mixed problem, the manipulator, its tip."""
