"""What `primray doctor` looks at, and how it says so."""
