"""Maps of the sample as pictures."""
