"""The pipeline: a job becomes a tool path, a program and a report."""
