"""Commands for the bench itself: which devices answer, homing, moving, reading, aligning, stopping."""
