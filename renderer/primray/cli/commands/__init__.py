"""The subcommands of `primray`, one file each."""
