"""The devices a rig file may name: one file each, with its keys and how to connect it."""
