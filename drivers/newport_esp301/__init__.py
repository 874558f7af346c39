"""The Newport ESP300 and ESP301 motion controllers."""
