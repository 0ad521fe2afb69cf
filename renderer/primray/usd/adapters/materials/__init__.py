"""Which surface a shape gets, and what its material says."""
