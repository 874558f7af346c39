"""`goniometer calibrate`: measure references, solve for the analyzer's slots, store what was found."""
