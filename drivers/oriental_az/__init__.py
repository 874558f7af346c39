"""Oriental Motor AZ drives."""
