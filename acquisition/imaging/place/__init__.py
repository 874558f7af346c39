"""Which point of the sample a pixel shows, and in which direction it is seen."""
