"""The habits of usdrecord and husk: their flags that primray reads in its own way, does anyway, or refuses with advice."""
