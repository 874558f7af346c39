"""The devices that a scene may hold: one file each, with its keys and what it puts on the bench."""
