"""Shipped machines, jobs and surfaces; found with `dnc.shipped.shipped_path`."""
