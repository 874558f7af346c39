"""Maps of the sample from the pictures of a run."""
