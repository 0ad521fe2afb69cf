"""Administration of all tenants: jobs, workers and quotas."""
