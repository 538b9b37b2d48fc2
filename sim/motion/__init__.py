"""How the axes move along the commanded path in time."""
