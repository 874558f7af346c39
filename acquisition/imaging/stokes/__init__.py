"""From the light behind the analyzer's states to the Stokes parameters of every pixel."""
