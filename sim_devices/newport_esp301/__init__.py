"""A Newport ESP301 controller and its axes."""
