"""Talk to hardware: a file or a folder a device family. Knows protocols and units, no physics."""
