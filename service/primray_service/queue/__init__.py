"""The queue of jobs: order.py decides which ones begin next and which running frames yield (pure), estimates.py has their
positions and estimated starts, for clients."""
