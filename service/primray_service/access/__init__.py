"""Who may ask, and for how much: auth.py tells who it is, keys.py makes keys; quotas.py and tenants.py say what may be used."""
