"""An Oriental Motor AZ drive and its motor."""
