"""What a stage is and holds, told without rendering it."""
