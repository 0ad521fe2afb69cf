"""What the core is handed for light path expressions."""
