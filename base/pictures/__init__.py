"""Pictures of bodies, off-screen."""
