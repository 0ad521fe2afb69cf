"""What lights have beyond their own prim: areas, colours, links, portals, photometric files, and the default ones."""
