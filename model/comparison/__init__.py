"""Models from the literature against one another on the same data."""
