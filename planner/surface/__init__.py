"""Parametric surfaces: B-spline basis, patches, curvature, parts, loading."""
