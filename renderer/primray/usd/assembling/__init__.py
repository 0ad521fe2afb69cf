"""Assembly of a description from translated shapes, prototypes, placements and lights."""
