"""`goniometer compare`: the models of the literature, ranked."""
