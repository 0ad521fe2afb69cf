"""`primray doctor`: why a stage comes out slow, grey, dark or empty, from a few seconds of rendering; `inspect` and
`estimate`."""
