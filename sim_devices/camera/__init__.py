"""A simulated camera: a plate of materials and markers, the lens that sees it, and what the lens adds."""
