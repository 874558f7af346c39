"""The runs that a folder holds: list, search, open."""
