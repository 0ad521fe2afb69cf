"""One file a subcommand of `primray`."""
