"""The queue of jobs: order.py is the order, turns.py the next claims, estimate.py start times, rates.py durations, positions.py
reports to clients."""
