"""A Stanford Research SR830 lock-in amplifier."""
