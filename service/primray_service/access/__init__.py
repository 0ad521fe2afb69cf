"""Authentication and quotas: auth.py identifies callers, keys.py makes keys, quotas.py and tenants.py limit what callers may
use."""
