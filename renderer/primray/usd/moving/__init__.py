"""What moves while the shutter is open, as numbers: where it stands at any time, and at which times to say so. No USD."""
