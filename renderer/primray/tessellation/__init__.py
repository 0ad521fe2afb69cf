"""Tessellation before rendering: subdivision surfaces, NURBS patches and ribbons diced to triangles for the camera's view."""
