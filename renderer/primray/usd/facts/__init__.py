"""Facts about a stage and its contents, found without rendering it."""
