"""What has been translated of a stage, put together: shapes, prototypes, placements and lights become a description."""
