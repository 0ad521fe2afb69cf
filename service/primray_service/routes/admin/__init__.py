"""What an administrator does for all tenants: look at jobs, change them, and set quotas."""
