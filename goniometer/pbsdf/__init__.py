"""A fitted surface as a table of Mueller matrices for the renderer Mitsuba 3."""
