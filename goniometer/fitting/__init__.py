"""`goniometer fit` of one scan: its data, its result in words, its files."""
