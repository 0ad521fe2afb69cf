"""An interactive picture for notebooks, with sliders for exposure and error. It needs no kernel: everything is in its HTML."""
