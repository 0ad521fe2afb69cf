"""How numbers are stored in files of pictures: bits, halves and floats, scene-linear or by a view."""
