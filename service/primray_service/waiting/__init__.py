"""Jobs that wait: order.py says who comes first, estimate.py when a job's turn comes, rates.py how long frames took, places.py
tells clients."""
