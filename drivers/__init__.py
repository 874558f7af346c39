"""Talk to hardware: one file a device family. Knows protocols and units, no physics."""
