"""Facts about a stage and its files, found without rendering it."""
