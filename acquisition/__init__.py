"""From a recipe to steps, readings, Stokes points, a live fit and files."""
