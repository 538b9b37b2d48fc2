"""From surface and driving planes to passes: tracing, fitting, scallop, pick feed."""
