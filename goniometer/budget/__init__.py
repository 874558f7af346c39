"""`goniometer budget`: what accuracy will cost, before the scan."""
