"""The unit cell of a long segment under screw periodicity."""
