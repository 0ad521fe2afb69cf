"""Why a stage comes out slow, grey, dark or empty: it is prepared and sampled for some seconds, and asked about that."""
