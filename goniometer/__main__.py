"""`python -m goniometer`."""

from goniometer.cli import main

main()
