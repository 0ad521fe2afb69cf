"""Command lines written for usdrecord and husk: flags that primray interprets differently, ignores, or refuses with advice."""
