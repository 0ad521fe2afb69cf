"""The HTTP job service: job -> store -> worker -> one render process. Empty so far; it knows neither USD nor C++."""
