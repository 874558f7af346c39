"""An SMC LEC controller and its step table."""
