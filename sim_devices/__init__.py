"""The bench without hardware: byte-level devices in one world lit by the model."""
