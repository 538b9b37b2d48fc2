"""Ball-end finishing tool paths on parametric surfaces, as planar cubic B-splines."""
